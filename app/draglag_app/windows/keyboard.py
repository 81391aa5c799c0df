"""The operator's keys: during a run the participant's window mostly has the keyboard."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import QObject

if TYPE_CHECKING:
    from draglag_app.windows.window import OperatorWindow


class Keyboard(QObject):
    """Brings the operator's window forward where a key needs it."""

    def __init__(self, window: OperatorWindow) -> None:
        super().__init__(window)
        self._window = window
        self._lent = False

    def serve(self) -> None:
        """Make the keys work in the participant's window."""
        participant = self._window.space.recording.window
        if participant is not None:
            self._window.actions_table.serve(participant)

    def come_to(self, page: str) -> None:
        """Show a page in front."""
        self._window.go(page)
        if self._window.space.recording.window is not None:
            self._window.raise_()
            self._window.activateWindow()

    def note(self) -> None:
        """Move the keyboard to the note field."""
        participant = self._window.space.recording.window
        self._lent = participant is not None and participant.isActiveWindow()
        self.come_to("record")
        self._window.record.note.setFocus()

    def give_back(self) -> None:
        """Give the keyboard back to the participant."""
        participant = self._window.space.recording.window
        if participant is not None and self._lent:
            participant.raise_()
            participant.activateWindow()
            participant.setFocus()
        self._lent = False
