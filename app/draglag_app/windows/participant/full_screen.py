"""A window on a whole screen."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, QTimer
from PySide6.QtGui import QScreen
from PySide6.QtWidgets import QWidget

# A desktop that refuses every time shall not be asked for ever.
_MOST_TRIES = 5


class FullScreen(QObject):
    """Fills a screen with a window.

    X desktops drop the state of a hidden window: full screen is then requested again.
    """

    def __init__(self, window: QWidget) -> None:
        super().__init__(window)
        self._window = window
        self._tries = 0
        window.installEventFilter(self)

    def fill(self, screen: QScreen) -> None:
        """Show the window on the whole screen."""
        self._tries = _MOST_TRIES
        self._window.setScreen(screen)
        self._window.setGeometry(screen.geometry())
        self._window.showFullScreen()
        self._window.setScreen(screen)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.WindowStateChange and self._lost():
            QTimer.singleShot(0, self, self._fill_again)
        return super().eventFilter(watched, event)

    def _lost(self) -> bool:
        shown = self._window.isVisible() and not self._window.isMinimized()
        return self._tries > 0 and shown and not self._window.isFullScreen()

    def _fill_again(self) -> None:
        if self._lost():
            self._tries -= 1
            self._window.showFullScreen()
