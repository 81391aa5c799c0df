"""Opening the operator's window."""

from __future__ import annotations

import signal
import sys
from pathlib import Path

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QWidget

from draglag.system.temporary import sweep
from draglag_app.windows.application import install_excepthook, make_application
from draglag_app.windows.settings import load_settings, settings_path
from draglag_app.windows.window import OperatorWindow

# What a title bar and borders take of a screen; how much they do is known only once they are there.
_AROUND_PX = (16, 48)


def show_whole(window: QWidget) -> None:
    """Show a window, maximised if too large."""
    room = window.screen().availableGeometry().size()
    if window.width() + _AROUND_PX[0] > room.width() or window.height() + _AROUND_PX[1] > room.height():
        window.showMaximized()
    else:
        window.show()


def open_operator_window(session: Path | None = None) -> int:
    """The window's exit code, once closed."""
    file = settings_path()
    settings, problem = load_settings(file)
    application = make_application(sys.argv[:1], settings)
    sweep(Path(settings.folder))
    window = OperatorWindow(settings, file)
    install_excepthook(lambda text: window.notify("error", text))
    if problem:
        window.notify("warning", problem)
    window.restore()
    show_whole(window)
    if session is not None:
        window.space.open(session, lambda: window.go("results"))
    else:
        window.offer_salvage()
        last = next((path for path in map(Path, settings.recent) if path.is_file()), None)
        if settings.reopen and last is not None:
            window.open_file(last)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda number, frame: window.end())
    # Python sees a signal only while it runs: give it the chance.
    pulse = QTimer()
    pulse.timeout.connect(lambda: None)
    pulse.start(250)
    status = application.exec()
    pulse.stop()
    window.shut_down()
    sys.excepthook = sys.__excepthook__
    return status
