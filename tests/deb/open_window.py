"""``open_window.py [SESSION]``: open the installed program's window as its command line does, and close it.

Prints the window's title, and ``session`` once the session is open, or ``empty`` without one. Run by the package's
interpreter in the tested root system.
"""

from __future__ import annotations

import sys

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication

from draglag_app.cli import main
from draglag_app.windows.window import OperatorWindow

LOOK_EVERY_MS = 100


def look(timer: QTimer) -> None:
    """Once the window shows what it was opened on, print that and close it."""
    for window in QApplication.topLevelWidgets():
        if isinstance(window, OperatorWindow) and window.isVisible():
            path = window.space.path
            if (len(sys.argv) > 1) != (path is not None):
                continue
            print(window.windowTitle(), "session" if path else "empty", sep=": ", flush=True)
            timer.stop()
            window.end()


# The application is made by the command line; a timer needs one only when it runs.
_make = QApplication.__init__


def made(self: QApplication, *arguments: object) -> None:
    """The application, with a timer that looks for the window."""
    _make(self, *arguments)
    timer = QTimer(self)
    timer.timeout.connect(lambda: look(timer))
    timer.start(LOOK_EVERY_MS)


QApplication.__init__ = made  # type: ignore[method-assign,assignment]
main(sys.argv[1:])
