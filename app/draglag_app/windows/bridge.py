"""The only bridge from other threads' events to Qt signals."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import QObject, Qt, Signal

from draglag_app.session import events


@dataclass(frozen=True)
class Prompted:
    """What the participant reads, and the target's ``kind``, if any."""

    text: str
    kind: str = ""


class SessionBridge(QObject):
    """Emits signals in this object's thread, in bunches: a 1 kHz source costs one wake-up, not a thousand."""

    device_opened = Signal(object)
    state_changed = Signal(object)
    resting = Signal(object)
    run_queued = Signal(object)
    run_started = Signal(object)
    run_previewed = Signal(object)
    run_finished = Signal(object)
    samples_arrived = Signal(object)
    taps_arrived = Signal(object)
    device_fault = Signal(object)
    notice_raised = Signal(object)
    disk_status = Signal(object)
    place_wanted = Signal(object)
    session_finished = Signal(object)
    prompted = Signal(object)
    crashed = Signal(object)
    """The exception that ended the session's thread; no file was closed."""
    _wake = Signal()

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._lock = threading.Lock()
        self._waiting: list[Any] = []
        self._woken = False
        self._wake.connect(self._deliver, Qt.ConnectionType.QueuedConnection)

    def listener(self, event: events.Event | Prompted) -> None:
        """Queue an event, from any thread."""
        self._post(event)

    def failed(self, error: Exception) -> None:
        """Queue the session thread's exception, from any thread."""
        self._post(error)

    def _post(self, item: Any) -> None:
        with self._lock:
            self._waiting.append(item)
            if self._woken:
                return
            self._woken = True
        self._wake.emit()

    def _deliver(self) -> None:
        # Bounded, so that a simulation at full speed cannot starve the window.
        with self._lock:
            items, self._waiting = self._waiting[:100], self._waiting[100:]
            self._woken = again = bool(self._waiting)
        for item in items:
            self._emitter(item)(item)
        if again:
            self._wake.emit()

    def _emitter(self, item: Any) -> Callable[[Any], None]:
        emitters: dict[type, Any] = {
            events.DeviceOpened: self.device_opened,
            events.StateChanged: self.state_changed,
            events.Resting: self.resting,
            events.RunQueued: self.run_queued,
            events.RunStarted: self.run_started,
            events.RunPreviewed: self.run_previewed,
            events.RunFinished: self.run_finished,
            events.SamplesArrived: self.samples_arrived,
            events.TapsArrived: self.taps_arrived,
            events.DeviceFault: self.device_fault,
            events.NoticeRaised: self.notice_raised,
            events.DiskStatus: self.disk_status,
            events.PlaceWanted: self.place_wanted,
            events.SessionFinished: self.session_finished,
            Prompted: self.prompted,
        }
        emit: Callable[[Any], None] = emitters.get(type(item), self.crashed).emit
        return emit
