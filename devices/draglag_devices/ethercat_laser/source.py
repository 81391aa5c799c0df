"""The laser on an EtherCAT bus as a source."""

from __future__ import annotations

import contextlib
import json
import os
import select
import subprocess
import tempfile
import threading
import time
from collections import deque
from dataclasses import dataclass, field
from typing import IO, Any

import numpy as np

from draglag.errors import cause
from draglag.messages import message, unpacked
from draglag.recording import ClockBounds, FloatArray, LaserTrace, concatenate
from draglag_devices.addresses import Address
from draglag_devices.clockmap import OnlineClockMap
from draglag_devices.ethercat_laser.disturbed import Disturbances
from draglag_devices.ethercat_laser.helper import start
from draglag_devices.ethercat_laser.waits import CLOSE_S, MESSAGE_S, OPEN_S
from draglag_devices.source import Batch, DeviceError, Notice, SourceInfo

STREAM = "laser"
_MOST_RESPAWNS = 3
_NS = 1e-9


def ethercat_source(address: Address, role: str) -> EthercatLaser:
    """The source at ``ethercat:IFACE?channel=1|2&light=high|low&position=P``. Raises DeviceError.

    ``light``: the sensor's output in light. ``position``: the EL1252's on the line, coupler 1.
    """
    address.only("channel", "light", "position")
    channel = int(address.choice("channel", ("1", "2"), "1"))
    light_is_high = address.choice("light", ("high", "low"), "high") == "high"
    place = address.options.get("position", "0")
    if not place.isdecimal() or len(place) > 5 or ("position" in address.options and int(place) < 2):
        problem = message("option position={place} is no place on the line", place=place)
        raise DeviceError(address.text, problem, "write position=2 for the first device after the coupler")
    return EthercatLaser(address.text, role, address.target, channel, light_is_high, int(place))


@dataclass
class _Gathered:
    laser: list[LaserTrace] = field(default_factory=list)
    clock: list[ClockBounds] = field(default_factory=list)
    notices: list[Notice] = field(default_factory=list)


class EthercatLaser:
    """A ``Source``; each set-up is an epoch.

    Device stamps count from ``details["device_zero_ns"]`` (since 2000-01-01), to keep nanoseconds.
    """

    realtime = True

    def __init__(
        self, address: str, role: str, interface: str, channel: int, light_is_high: bool = True, position: int = 0
    ) -> None:
        self.address = address
        self.role = role
        self._disturbances = Disturbances()
        self._interface = interface
        self._channel, self._position = channel, position
        self._light_is_high = light_is_high
        self._process: subprocess.Popen[bytes] | None = None
        self._complaints: IO[bytes] | None = None
        self._rest = b""
        self._map = OnlineClockMap()
        self._zero_ns: int | None = None
        self._epoch = 0
        self._respawns = 0
        self._until_s = 0.0
        self._alive = False
        self._died_s: float | None = None
        self._early = _Gathered()
        self._compared_s = -np.inf  # host time of the last comparison
        self._asked: deque[tuple[float, threading.Event]] = deque()  # filled by other threads

    @property
    def disturbed(self) -> dict[str, int]:
        """Refused cycles, by reason."""
        return dict(self._disturbances.total)

    def final_notices(self) -> tuple[Notice, ...]:
        """Disturbed cycles not yet reported."""
        rest = self._disturbances.rest(time.monotonic())
        return () if rest is None else (rest,)

    def synchronise(self) -> threading.Event:
        """The event of the next clock pair, four a second."""
        done = threading.Event()
        self._asked.append((time.monotonic(), done))
        return done

    # --- Source -----------------------------------------------------------------------------------------------

    def open(self) -> SourceInfo:
        self.close()
        self._zero_ns, self._epoch, self._respawns, self._died_s = None, 0, 0, None
        self._early = _Gathered()
        self._spawn()
        patience_s = time.monotonic() + OPEN_S
        try:
            while time.monotonic() < patience_s:
                messages = self._messages(MESSAGE_S)
                for content in messages:
                    self._take(content, self._early)
                for content in messages:
                    if content["m"] == "ready":
                        return self._describe(content)
            raise DeviceError(self.address, "the EtherCAT bus did not get ready", "switch the coupler off and on")
        except _Ended:
            error = self._ended_error()
            self.close()
            raise error from None
        except DeviceError:
            self.close()
            raise

    def read(self, timeout_s: float) -> Batch:
        gathered, self._early = self._early, _Gathered()
        try:
            if self._process is None:
                raise DeviceError(self.address, "the laser is not open", "open it first")
            for content in self._messages(timeout_s):
                self._take(content, gathered)
        except _Ended:
            self._respawn(gathered)
        # While the bus is away there is nothing to compare with.
        while self._asked and (self._asked[0][0] <= self._compared_s or not self._alive):
            self._asked.popleft()[1].set()
        return Batch(
            until_s=self._until_s,
            laser=concatenate(gathered.laser) if gathered.laser else None,
            clock=concatenate(gathered.clock) if gathered.clock else None,
            notices=tuple(gathered.notices),
            alive=self._alive,
        )

    def close(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            for pipe in (process.stdin, process.stdout):
                if pipe is not None:
                    with contextlib.suppress(OSError):
                        pipe.close()
            try:
                process.wait(CLOSE_S)
            except subprocess.TimeoutExpired:
                with contextlib.suppress(OSError):  # a launcher with capabilities may not be ours to signal
                    process.kill()
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(CLOSE_S)
        if self._complaints is not None:
            self._complaints.close()
            self._complaints = None
        self._rest, self._alive = b"", False

    # --- the process ------------------------------------------------------------------------------------------

    def _spawn(self) -> None:
        self._complaints = tempfile.TemporaryFile()  # noqa: SIM115  (it lives as long as the process)
        arguments = [self._interface, "--channel", str(self._channel), "--first-epoch", str(self._epoch)]
        if self._position:
            arguments += ["--position", str(self._position)]
        try:
            self._process = start(*arguments, complaints=self._complaints)
        except OSError as error:
            self.close()
            raise DeviceError(
                self.address,
                message("the EtherCAT process cannot be started ({why})", why=cause(error)),
                "install draglag again",
            ) from None

    def _messages(self, timeout_s: float) -> list[dict[str, Any]]:
        if self._process is None or self._process.stdout is None:
            raise _Ended
        pipe = self._process.stdout.fileno()
        if not select.select([pipe], [], [], timeout_s)[0]:
            return []
        received = os.read(pipe, 1 << 16)
        if not received:
            raise _Ended
        *lines, self._rest = (self._rest + received).split(b"\n")
        return [json.loads(line, object_hook=unpacked) for line in lines]

    def _respawn(self, gathered: _Gathered) -> None:
        error = self._ended_error()
        self.close()
        if self._died_s is None:
            self._died_s = self._until_s
        if self._respawns >= _MOST_RESPAWNS:
            raise error
        self._respawns += 1
        self._epoch += 1
        text = message("The laser sensor is lost: its EtherCAT process ended. draglag starts it again.")
        gathered.notices.append(Notice(time.monotonic(), "error", text, "lost"))
        self._spawn()

    def _ended_error(self) -> DeviceError:
        last = ""
        if self._complaints is not None:
            self._complaints.seek(0)
            lines = self._complaints.read().decode(errors="replace").strip().splitlines()
            last = lines[-1] if lines else ""
        problem = message(
            "the EtherCAT process ended unexpectedly ({last})" if last else "the EtherCAT process ended unexpectedly",
            last=last,
        )
        return DeviceError(self.address, problem, "open the laser again")

    # --- messages ---------------------------------------------------------------------------------------------

    def _take(self, content: dict[str, Any], gathered: _Gathered) -> None:
        kind = content["m"]
        if kind == "tick":
            # The process knows nothing of the time before a respawn; what was reported stays reported.
            self._until_s = max(self._until_s, content["until"] * _NS)
            self._alive = bool(content["alive"])
        elif kind == "edges":
            gathered.laser.append(self._edges(content))
            self._until_s = max(self._until_s, content["until"] * _NS)
        elif kind == "clock":
            bounds = self._bounds(content)
            self._map.add(bounds)
            gathered.clock.append(bounds)
            self._compared_s = float(bounds.host_min_s[0])
        elif kind == "gap":
            gathered.laser.append(_gap(content["start"] * _NS, content["end"] * _NS, content["missed"]))
        elif kind == "notice":
            words = content["level"], content["text"], content.get("state", "")
            gathered.notices.append(Notice(content["t"] * _NS, *words))
        elif kind == "cycles":
            when = content["since"] * _NS, content["t"] * _NS
            notice = self._disturbances.take(*when, content["cycles"], content["refused"])
            gathered.notices += [notice] if notice is not None else []
        elif kind == "ready":
            self._begin_epoch(content, gathered)
        elif kind == "refused":
            raise DeviceError(self.address, content["problem"], content["remedy"])

    def _begin_epoch(self, content: dict[str, Any], gathered: _Gathered) -> None:
        self._epoch, self._alive = content["epoch"], True
        if self._zero_ns is None:
            self._zero_ns = content["dc"] // 1_000_000_000 * 1_000_000_000
        if self._died_s is not None:
            gathered.laser.append(_gap(self._died_s, time.monotonic(), 0))
            text = message("The laser sensor is back and records again.")
            gathered.notices.append(Notice(time.monotonic(), "info", text, "back"))
            self._died_s = None

    def _device_s(self, stamps_ns: list[int]) -> FloatArray:
        zero_ns = self._zero_ns or 0
        # Subtracted as integers first: 64-bit floats since 2000 would keep only 0.1 us.
        return np.array([(stamp - zero_ns) * _NS for stamp in stamps_ns], dtype=np.float64)

    def _edges(self, content: dict[str, Any]) -> LaserTrace:
        device_s = self._device_s([stamp for stamp, _ in content["edges"]])
        level = np.array([level for _, level in content["edges"]], dtype=np.int64)
        return LaserTrace(
            t_s=self._map.to_host(device_s),
            light=level if self._light_is_high else 1 - level,
            device_t_s=device_s,
            epoch=np.full(len(level), content["epoch"], np.int64),
            missed=content["missed"],
        )

    def _bounds(self, content: dict[str, Any]) -> ClockBounds:
        return ClockBounds(
            STREAM,
            self._device_s([content["dc"]]),
            np.array([content["low"] * _NS]),
            np.array([content["high"] * _NS]),
            np.array([content["epoch"]], np.int64),
        )

    def _describe(self, ready: dict[str, Any]) -> SourceInfo:
        names = " + ".join(slave["name"] or f"0x{slave['product']:08X}" for slave in ready["slaves"])
        details: dict[str, str | float | int] = {
            "device_zero_ns": self._zero_ns or 0,
            "channel": self._channel,
            "position": ready["position"],
            "level_at_start": ready["level"],
            "working_counter": ready["expected_wkc"],
        }
        for position, slave in enumerate(ready["slaves"]):
            details[f"device_{position}"] = f"product 0x{slave['product']:08X}, revision 0x{slave['revision']:08X}"
        return SourceInfo(
            self.address,
            self.role,
            message(
                "{names} on {interface}, channel {channel}",
                names=names,
                interface=self._interface,
                channel=self._channel,
            ),
            message("EtherCAT distributed clock, compared with the host's in every cycle"),
            details,
        )


class _Ended(Exception):
    """The bus process closed its output."""


def _gap(start_s: float, end_s: float, missed: int) -> LaserTrace:
    empty = np.empty(0)
    return LaserTrace(empty, np.empty(0, np.int64), empty, np.empty(0, np.int64), np.array([[start_s, end_s]]), missed)
