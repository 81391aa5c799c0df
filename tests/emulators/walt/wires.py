"""Two wires to the firmware: a pty for the real library, and a stepped one that runs hours in milliseconds."""

from __future__ import annotations

import contextlib
import fcntl
import os
import pty
import select
import struct
import termios
import threading
import time
import tty
from pathlib import Path

import numpy as np

from emulators.walt.firmware import Firmware


class SteppedWire:
    """A port (write, read, close) on a clock of its own: reading lets time pass. ``events`` act on the firmware."""

    def __init__(self, firmware_of=Firmware, start_s: float = 1000.0, **options) -> None:
        self.t_s = start_s
        self.firmware = firmware_of(start_s, **options)
        self.events: list[tuple[float, object]] = []
        self.gone: Exception | None = None
        self.closed = 0

    def now(self) -> float:
        return self.t_s

    def pause(self, duration_s: float) -> None:
        self._advance(self.t_s + duration_s)

    def at(self, host_s: float, action) -> None:
        """Call ``action(firmware, host_s)`` when time gets there."""
        self.events.append((host_s, action))
        self.events.sort(key=lambda event: event[0])

    def _advance(self, to_s: float) -> None:
        while self.events and self.events[0][0] <= to_s:
            at_s, action = self.events.pop(0)
            self.t_s = max(self.t_s, at_s)
            action(self.firmware, at_s)
        self.t_s = max(self.t_s, to_s)

    def write(self, data: bytes) -> None:
        if self.gone:
            raise self.gone
        self._advance(self.t_s + 20e-6)
        self.firmware.receive(data, self.t_s)

    def read(self, timeout_s: float) -> bytes:
        deadline_s = self.t_s + max(0.0, timeout_s)
        while True:
            if self.gone:
                raise self.gone
            data = self.firmware.take(self.t_s)
            if data or self.t_s >= deadline_s:
                # The host wakes a moment after the byte came.
                self._advance(self.t_s + 30e-6)
                return data
            nearest = min(self.firmware.next_s, self.events[0][0] if self.events else np.inf, deadline_s)
            self._advance(max(nearest, self.t_s + 1e-6))

    def close(self) -> None:
        self.closed += 1


class WaltOnPty:
    """A WALT on a pseudo terminal, whose link keeps its name when unplugged and replugged.

    ``firmware`` may be changed under ``lock``. A context manager; ``path`` is the port.
    """

    def __init__(self, folder: Path, *, drift: float = 0.0, version: str = "6", seed: int = 0) -> None:
        self.path = folder / "ttyWALT0"
        self.lock = threading.RLock()
        self._options = {"drift": drift, "version": version, "seed": seed}
        self.firmware = Firmware(time.monotonic(), **self._options)
        self._master = self._slave = -1
        self._wake_r, self._wake_w = os.pipe()
        self._stop = False
        self._events: list[tuple[float, object]] = []
        self._thread = threading.Thread(target=self._serve, name="emulated-walt", daemon=True)

    def __enter__(self) -> WaltOnPty:
        self.plug()
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._stop = True
        os.write(self._wake_w, b"x")
        self._thread.join(5)
        self.unplug()
        os.close(self._wake_r)
        os.close(self._wake_w)

    @property
    def plugged(self) -> bool:
        return self._master >= 0

    def plug(self) -> None:
        """Connect it; its clock starts from zero, as after a loss of power."""
        with self.lock:
            self._master, self._slave = pty.openpty()
            tty.setraw(self._slave)
            os.set_blocking(self._master, False)
            self.firmware = Firmware(time.monotonic(), **self._options)
            fresh = self.path.with_name(self.path.name + ".new")
            fresh.symlink_to(os.ttyname(self._slave))
            fresh.replace(self.path)
        self._poke()

    def unplug(self) -> None:
        """Pull the cable: whoever has the port open gets a hang-up."""
        with self.lock, contextlib.suppress(OSError):
            if self._master >= 0:
                self.path.unlink(missing_ok=True)
                os.close(self._slave)
                os.close(self._master)
                self._master = self._slave = -1
        self._poke()

    def at(self, host_s: float, action) -> None:
        """Call ``action(firmware, host_s)`` when time gets there; the stamp is ``host_s`` however late the call."""
        with self.lock:
            self._events.append((host_s, action))
            self._events.sort(key=lambda event: event[0])
        self._poke()

    def edges(self, host_s, light) -> None:
        """Let the laser change at these times."""
        for at_s, value in zip(np.asarray(host_s).tolist(), np.asarray(light).tolist(), strict=True):
            self.at(at_s, lambda firmware, t, value=value: firmware.edge(t, value))

    def shocks(self, host_s) -> None:
        for at_s in np.asarray(host_s).tolist():
            self.at(at_s, lambda firmware, t: firmware.shock(t))

    def _poke(self) -> None:
        with contextlib.suppress(OSError):
            os.write(self._wake_w, b"x")

    def _serve(self) -> None:
        # An instrument has a processor of its own: the load of this computer does not slow it.
        with contextlib.suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, 0, -15)
        while not self._stop:
            with self.lock:
                self._work()
                waiting = self._events[0][0] if self._events else np.inf
                wait_s = min(waiting, self.firmware.next_s) - time.monotonic()
                watched = [self._wake_r] + ([self._master] if self.plugged else [])
            try:
                ready, _, _ = select.select(watched, [], [], min(max(wait_s, 0.0), 1.0))
            except OSError:
                continue
            if self._wake_r in ready:
                os.read(self._wake_r, 4096)

    def _work(self) -> None:
        asked = b""
        if self.plugged:
            with contextlib.suppress(BlockingIOError):
                # A pty keeps what was echoed or sent before anybody listened; nothing else is lost or changed.
                asked = os.read(self._master, 4096)
        # However late this thread gets its turn: what happened before a question was read is in its answer.
        now_s = time.monotonic()
        while self._events and self._events[0][0] <= now_s:
            at_s, action = self._events.pop(0)
            action(self.firmware, at_s)
        if not self.plugged:
            return
        if asked:
            self.firmware.receive(asked, now_s)
        data = self.firmware.take(time.monotonic())
        if data and self._room():
            with contextlib.suppress(BlockingIOError):
                while data:
                    data = data[os.write(self._master, data) :]

    def _room(self) -> bool:
        """Whether somebody reads: a pty that nobody empties fills up, and a WALT does not wait for its reader."""
        queued = struct.unpack("i", fcntl.ioctl(self._slave, termios.FIONREAD, b"\0" * 4))[0]
        return bool(queued < 3500)
