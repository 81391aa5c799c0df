"""Waiting, attentive to operator, devices, disk."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from functools import partial

import numpy as np

from draglag.errors import DraglagError
from draglag.latency.conduct import STANDSTILL
from draglag.messages import message
from draglag.recording import LogEntry
from draglag_app.session import events
from draglag_app.session.control import Control
from draglag_app.session.display import Display
from draglag_app.session.machine import Signal
from draglag_app.session.saver import Saver
from draglag_app.session.standstill import Pulse
from draglag_devices.timebase import TimeBase

# Simulated time is advanced in steps, so that nobody runs far ahead and requests are heard in between.
_STEP_S = 1.0
TICK_S = 0.05
STUCK_S = 30.0
_DRAIN_S = 3.0
_DISK_EVERY_S = 5.0
_DISK_LOW = 200_000_000


class Watch:
    """Waits for the session's thread; ``roles``: of all sources."""

    def __init__(
        self,
        time_base: TimeBase,
        roles: tuple[str, ...],
        display: Display,
        listener: events.Listener,
        control: Control,
        saver: Saver,
    ) -> None:
        self._time = time_base
        self._roles = roles
        self._display = display
        self._emit = listener
        self._control = control
        self._saver = saver
        self._disk_checked = -np.inf
        self._disk_warned = False
        self.pulse = Pulse()

    def wait_until(
        self,
        until_s: float,
        roles: tuple[str, ...],
        *,
        frames: bool = False,
        condition: Callable[[], bool] = lambda: False,
        abortable: bool = True,
    ) -> Signal | None:
        """The signal that ended the wait before ``until_s`` or ``condition()``, else None."""
        while True:
            if not abortable:
                self._control.take_abort()  # keeps the request to stop altogether
            signal = self._interruption(roles)
            if signal is not None:
                return signal
            now_s = self._time.now()
            if frames and not self._save_frames(min(now_s, until_s)):
                return Signal.FAILURE
            if now_s >= until_s or condition():
                return None
            if self._time.realtime:
                self._control.wait(min(TICK_S, until_s - now_s))
            else:
                self._step(min(now_s + _STEP_S, until_s))

    def _save_frames(self, until_s: float) -> bool:
        """Whether what the display showed could be saved."""
        trace = self._display.frames(until_s)
        try:
            self._saver.call(partial(self._saver.append_display, trace))
        except DraglagError:
            return False
        return True

    def _step(self, to_s: float) -> None:
        """Advance simulated time, once every source has reported up to it or is given up."""
        if not np.isfinite(to_s):
            self._control.wait(TICK_S)
            return
        self._time.advance_to(to_s)
        for role in self._saver.wait_past(to_s, self._roles, STUCK_S):
            self._saver.call(partial(self._saver.give_up, role))

    def _interruption(self, roles: tuple[str, ...]) -> Signal | None:
        self.check_standstill()
        for text in self._control.take_notes():
            self.log("note", "operator", text)
        self.check_disk()
        if self._saver.failure is not None:
            return Signal.FAILURE
        if any(role in self._saver.lost for role in roles):
            return Signal.DEVICE_LOST
        if self._control.aborting:
            return Signal.ABORT
        return None

    def drain(self, until_s: float, roles: tuple[str, ...]) -> Signal | None:
        """Wait for data up to ``until_s``; a signal where a device is lost or saving failed."""
        self._time.advance_to(until_s)
        patience_s = STUCK_S if not self._time.realtime else max(0.0, until_s - self._time.now()) + _DRAIN_S
        late = self._saver.wait_past(until_s, roles, patience_s)
        for role in late:
            self.log("warning", role, message("{role} did not report up to the end of the run", role=role))
        if self._saver.failure is not None:
            return Signal.FAILURE
        return Signal.DEVICE_LOST if any(role in self._saver.lost for role in roles) else None

    def check_standstill(self) -> None:
        """Log a standstill, in real time alone."""
        for found in self.pulse.take():
            if self._time.realtime:
                self.log("error", STANDSTILL, found.message())

    def check_disk(self, force: bool = False) -> None:
        if not force and time.monotonic() - self._disk_checked < _DISK_EVERY_S:
            return
        self._disk_checked = time.monotonic()
        folder = self._saver.path.absolute().parent
        try:
            free, size = shutil.disk_usage(folder).free, self._saver.partial.stat().st_size
        except OSError:
            return  # the writer meets the same error and reports it
        self._emit(events.DiskStatus(free, size))
        if free < _DISK_LOW and not self._disk_warned:
            self._disk_warned = True
            self.log(
                "warning",
                "disk",
                message("only {free} MB are free in {folder}: make room", free=free // 1_000_000, folder=folder),
            )

    def log(self, level: str, source: str, text: str) -> None:
        entry = LogEntry(self._time.now(), level, source, text)
        try:
            self._saver.call(lambda: self._saver.log(entry))
        except DraglagError:
            return  # the saver keeps the failure
        if level != "note":
            self._emit(events.NoticeRaised(entry.t_s, level, source, text))
