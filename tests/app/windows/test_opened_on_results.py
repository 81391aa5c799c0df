"""A session that the window is opened on is read, analysed and shown."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication

from draglag_app.windows.main import open_operator_window
from draglag_app.windows.window import OperatorWindow


def test_the_window_opens_on_the_results_of_a_session(
    qapp: QApplication, session_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DRAGLAG_SETTINGS", str(tmp_path / "settings.toml"))
    monkeypatch.setattr(sys, "excepthook", sys.excepthook)  # put back afterwards
    seen: list[str] = []
    closed: list[OperatorWindow] = []

    def look() -> None:
        (window,) = (item for item in qapp.topLevelWidgets() if isinstance(item, OperatorWindow))
        if window.space.analysis is None:
            return
        seen.extend(name for name, (_, page) in window.pages.items() if page is window.stack.currentWidget())
        seen.append(str(window.space.path))
        watch.stop()
        window.close()
        closed.append(window)

    watch = QTimer()
    watch.timeout.connect(look)
    watch.start(20)
    assert open_operator_window(session_file) == 0
    closed.pop().deleteLater()
    assert seen == ["results", str(session_file)]
