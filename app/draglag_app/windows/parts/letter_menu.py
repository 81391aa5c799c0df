"""Menu entries chosen by typing; Qt's need marked letters."""

from __future__ import annotations

from PySide6.QtCore import QElapsedTimer, Qt
from PySide6.QtGui import QAction, QKeyEvent
from PySide6.QtWidgets import QApplication, QMenu

_MODIFIED = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.AltModifier | Qt.KeyboardModifier.MetaModifier


class LetterMenu(QMenu):
    """Quick letters are one word; one repeated goes to the next entry."""

    _typed = ""
    _since: QElapsedTimer | None = None

    def keyPressEvent(self, event: QKeyEvent) -> None:
        text = event.text()
        if not text.isalnum() or event.modifiers() & _MODIFIED:
            super().keyPressEvent(event)
            return
        pause_ms = QApplication.keyboardInputInterval()
        if self._since is None or self._since.hasExpired(pause_ms):
            self._typed = ""
        self._since = QElapsedTimer()
        self._since.start()
        self._typed += text.casefold()
        found = self._beginning_so()
        if found is not None:
            self.setActiveAction(found)
        event.accept()

    def _beginning_so(self) -> QAction | None:
        again = len(set(self._typed)) == 1  # the same letter: the next one; more letters: the present one may stay
        entries = [action for action in self.actions() if action.isEnabled() and not action.isSeparator()]
        present = self.activeAction()
        at = entries.index(present) + again if present in entries else 0
        for wanted in (self._typed, self._typed[0]) if again else (self._typed,):
            for action in entries[at:] + entries[:at]:
                if action.text().replace("&", "").casefold().startswith(wanted):
                    return action
        return None
