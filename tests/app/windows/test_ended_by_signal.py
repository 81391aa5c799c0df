"""A shutdown, kill or closed terminal ends the window in order: nobody is asked, nothing is lost."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication

from app.windows.conftest import wait_until
from draglag.store import read_session
from draglag_app.windows.window import OperatorWindow


def test_a_signal_closes_the_session_that_is_being_recorded(
    qapp: QApplication, open_window: Callable[..., OperatorWindow]
) -> None:
    window = open_window()
    finished: list[object] = []
    window.space.bridge.run_finished.connect(finished.append)
    window.ask("start")
    wait_until(qapp, lambda: bool(finished))
    # In the application's own loop, which it has to end: outside it the request would end dialogs of later tests.
    QTimer.singleShot(0, window.end)
    assert qapp.exec() == 0
    (path,) = Path(window.space.settings.folder).glob("*.h5*")
    assert path.suffix == ".h5"
    assert read_session(path).runs[0].outcome == "complete"
