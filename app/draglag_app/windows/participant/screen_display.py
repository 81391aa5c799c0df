"""The session's display on a participant's window."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, Qt, QTimer, Signal
from PySide6.QtGui import QGuiApplication, QScreen
from PySide6.QtWidgets import QApplication

from draglag.errors import DataError
from draglag.messages import message
from draglag.protocol.targets import Target
from draglag.recording import DisplayTrace, Screen
from draglag_app.session.control import Control
from draglag_app.session.display import Display
from draglag_app.windows.bridge import Prompted
from draglag_app.windows.participant.window import ParticipantWindow


class ScreenDisplay(QObject):
    """Called from the session's thread; the window draws in its own."""

    _show = Signal(object, float)
    _prompt = Signal(object)
    _hide = Signal()

    def __init__(self, window: ParticipantWindow) -> None:
        super().__init__(window)
        self._frames = window.frames
        queued = Qt.ConnectionType.QueuedConnection
        self._show.connect(window.show_target, queued)
        self._prompt.connect(window.set_prompt, queued)
        self._hide.connect(window.hide_target, queued)

    def show(self, target: Target, start_s: float) -> None:
        self._frames.clear()
        self._show.emit(target, start_s)

    def prompt(self, text: str) -> None:
        self._prompt.emit(text)

    def frames(self, until_s: float) -> DisplayTrace:
        return self._frames.take(until_s)

    def hide(self) -> None:
        self._hide.emit()


class WatchedDisplay:
    """Forwards to a display, and reports what the participant reads."""

    def __init__(self, display: Display, report: Callable[[Prompted], None]) -> None:
        self._display = display
        self._report = report
        self._text = ""

    def show(self, target: Target, start_s: float) -> None:
        self._display.show(target, start_s)
        self._report(Prompted(self._text, target.kind))

    def prompt(self, text: str) -> None:
        self._text = text
        self._display.prompt(text)
        self._report(Prompted(text))

    def frames(self, until_s: float) -> DisplayTrace:
        return self._display.frames(until_s)

    def hide(self) -> None:
        self._display.hide()


def numbered_screen(number: int) -> QScreen:
    """The screen, from 1. Raises DataError."""
    screens = QGuiApplication.screens()
    if not 1 <= number <= len(screens):
        known = ", ".join(f"{k} ({s.name()} {s.size().width()}×{s.size().height()})" for k, s in enumerate(screens, 1))
        raise DataError(
            message("there is no screen {number}", number=number), message("screens are {known}", known=known)
        )
    return screens[number - 1]


def record_on_screen(
    number: int, measure: Callable[[Display], Path], panel: Screen | None = None, control: Control | None = None
) -> Path:
    """The result of ``measure``, with the participant's window there. Raises what it raises, DataError.

    ``panel`` None: the desktop's size. Esc aborts ``control``'s run.
    """
    from draglag_app.windows.application import make_application

    application = make_application(sys.argv[:1])
    screen = numbered_screen(number)
    window = ParticipantWindow(panel or _panel_of(screen))
    outcome: dict[str, Any] = {}

    def work(display: Display) -> None:
        try:
            outcome["path"] = measure(display)
        except Exception as error:  # handed to the caller below
            outcome["error"] = error

    display = ScreenDisplay(window)
    if control is not None:
        window.aborted.connect(control.abort_run)
    window.show_on(screen)
    thread = threading.Thread(target=work, args=(display,), name="draglag-session")
    watch = QTimer()
    # Not quit(): that closes the window too, and the last window closed posts a wish to quit that outlives this loop.
    watch.timeout.connect(lambda: None if thread.is_alive() else application.exit())
    watch.start(50)
    thread.start()
    application.exec()
    thread.join()
    watch.stop()
    window.close()
    window.deleteLater()
    QApplication.processEvents()
    if "error" in outcome:
        raise outcome["error"]
    path: Path = outcome["path"]
    return path


def _panel_of(screen: QScreen) -> Screen:
    size, pixels = screen.physicalSize(), screen.size()
    return Screen(screen.name(), size.width() or 1.0, size.height() or 1.0, pixels.width(), pixels.height())
