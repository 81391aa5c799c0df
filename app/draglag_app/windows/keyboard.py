"""The operator's keys, whichever of the windows has the keyboard: during a run that is mostly the participant's."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import QObject

if TYPE_CHECKING:
    from draglag_app.windows.window import OperatorWindow


class Keyboard(QObject):
    """Brings the operator's window forward where a key needs it, and lets it make way again."""

    def __init__(self, window: OperatorWindow) -> None:
        super().__init__(window)
        self._window = window
        self._lent = False

    def serve(self) -> None:
        """Let the keys work on the participant's screen too, where one was just opened."""
        participant = self._window.space.recording.window
        if participant is not None:
            self._window.actions_table.serve(participant)

    def come_to(self, page: str) -> None:
        """Show a page to somebody whose keyboard may be with the participant's window."""
        self._window.go(page)
        if self._window.space.recording.window is not None:
            self._window.raise_()
            self._window.activateWindow()

    def note(self) -> None:
        """A note is to be written."""
        participant = self._window.space.recording.window
        self._lent = participant is not None and participant.isActiveWindow()
        self.come_to("record")
        self._window.record.note.setFocus()

    def give_back(self) -> None:
        """The note is written: on a single screen the operator's window makes way for the target again."""
        participant = self._window.space.recording.window
        if participant is not None and self._lent:
            participant.raise_()
            participant.activateWindow()
            participant.setFocus()
        self._lent = False
