"""One monitor for participant and operator."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import QObject

from draglag_app.session import events
from draglag_app.session.machine import Phase
from draglag_app.windows.bridge import Prompted
from draglag_app.windows.participant.rest_bar import RestBar
from draglag_app.windows.participant.window import ParticipantWindow

if TYPE_CHECKING:
    from draglag_app.windows.window import OperatorWindow


class OneMonitor(QObject):
    """Shows the operator's window in a rest, the participant's for a target.

    A desktop may refuse: a bar in the participant's window serves in rests.
    """

    def __init__(self, window: OperatorWindow) -> None:
        super().__init__(window)
        self._window = window
        self._bar: RestBar | None = None
        window.space.recording.dock = window.record.live.dock
        window.space.calibrating.dock = lambda picture: window.geometry_page.calibration.dock(picture)
        bridge = window.space.bridge
        bridge.resting.connect(lambda event: self._to_operator())
        bridge.place_wanted.connect(lambda event: self._to_operator())
        bridge.state_changed.connect(self._state_changed)
        bridge.prompted.connect(self._prompted)
        window.record.band.said.connect(self._said)

    def begin(self) -> None:
        """Follow a change of the participant's window."""
        self._bar = None
        participant = self._window.space.recording.window
        if participant is None or not participant.isWindow():
            return
        self._bar = RestBar(participant)
        self._bar.noted.connect(self._window.record.now.keep)
        self._bar.pressed.connect(self._window.ask)

    def _shared(self) -> ParticipantWindow | None:
        participant = self._window.space.recording.window
        if participant is None or not participant.isFullScreen():
            return None
        return participant if participant.screen() is self._window.screen() else None

    def _to_operator(self) -> None:
        if self._shared() is None or self._bar is None:
            return
        self._bar.offer()
        self._window.raise_()
        self._window.activateWindow()

    def _to_participant(self) -> None:
        """Hide and show: raising a window does not bring it to the front on every desktop."""
        if self._bar is None or self._bar.isHidden():
            return
        self._bar.hide()
        participant = self._shared()
        if participant is not None:
            participant.hide()
            participant.show_on(participant.screen())
            participant.activateWindow()

    def _state_changed(self, event: events.StateChanged) -> None:
        if event.phase is Phase.PREPARING:
            self._to_participant()

    def _prompted(self, event: Prompted) -> None:
        if event.text != "Rest" and (event.text or event.kind):
            self._to_participant()

    def _said(self, big: str, small: str) -> None:
        if self._bar is not None:
            self._bar.say(big, small)
