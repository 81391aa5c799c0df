"""A device scheme for draglag: a light sensor behind any program that writes a line at each edge.

``fifo:/path`` is a named pipe (``mkfifo /path``). Its lines are ``1`` where light comes onto the sensor and ``0`` where
it goes; each is stamped when it is read. A microcontroller is a pipe away: ``cat /dev/ttyUSB0 > /path``.
"""

from __future__ import annotations

import os
import select
import stat
import time
from pathlib import Path

import numpy as np

from draglag.recording import LaserTrace
from draglag_devices.addresses import Address
from draglag_devices.discovery import Found
from draglag_devices.source import Batch, DeviceError, Notice, SourceInfo

ROLES = ("laser",)
FORM = "fifo:/path/of/pipe"
USUAL = Path("/run/draglag")  # pipes there are listed by `draglag devices`


def open_source(address: Address, role: str) -> FifoLaser:
    """The sensor at ``fifo:/path``, not yet open. Raises DeviceError for an option: there are none."""
    address.only()
    if not address.target:
        raise DeviceError(address.text, "the address names no pipe", f"write {FORM}")
    return FifoLaser(address.text, Path(address.target), role)


def discover() -> list[Found]:
    """The pipes in the usual place."""
    pipes = sorted(USUAL.glob("*")) if USUAL.is_dir() else []
    return [Found(f"fifo:{path}", ROLES, "named pipe") for path in pipes if path.is_fifo()]


class FifoLaser:
    """One pipe, read without waiting for a whole line."""

    def __init__(self, address: str, path: Path, role: str) -> None:
        self.address, self.role, self._path = address, role, path
        self._file: int | None = None
        self._rest = b""

    def open(self) -> SourceInfo:
        try:
            if not stat.S_ISFIFO(os.stat(self._path).st_mode):
                raise DeviceError(self.address, "this is no named pipe", f"make one with mkfifo {self._path}")
            # For reading and writing: the pipe then has no end when a writer leaves.
            self._file = os.open(self._path, os.O_RDWR | os.O_NONBLOCK)
        except OSError as error:
            raise DeviceError(
                self.address, f"cannot be opened ({error.strerror})", "check its name and rights"
            ) from None
        return SourceInfo(self.address, self.role, f"pipe {self._path.name}", "stamped by the host when read")

    def read(self, timeout_s: float) -> Batch:
        assert self._file is not None, "open it first"
        ready, _, _ = select.select([self._file], [], [], timeout_s)
        now_s = time.monotonic()
        if not ready:
            return Batch(now_s)
        *lines, self._rest = (self._rest + os.read(self._file, 4096)).split(b"\n")
        words = [line.strip() for line in lines]
        light = [int(word) for word in words if word in (b"0", b"1")]
        strange = len(words) - len(light)
        notices = (Notice(now_s, "warning", f"{strange} lines were neither 0 nor 1"),) if strange else ()
        trace = LaserTrace(np.full(len(light), now_s), np.array(light, np.int64)) if light else None
        return Batch(now_s, laser=trace, notices=notices)

    def close(self) -> None:
        if self._file is not None:
            os.close(self._file)
            self._file = None
