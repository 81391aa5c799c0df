"""File dialogs stand in nobody's way: Esc on the participant's screen and the operator's keys work meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from PySide6.QtCore import Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QDialog, QFileDialog, QLineEdit, QMessageBox, QWidget

from draglag_app.session.machine import Phase
from draglag_app.windows import files
from draglag_app.windows.window import OperatorWindow

Key = Qt.Key


def press(window: QWidget, key: Qt.Key) -> None:
    """As the window system delivers it, which asks what is blocked by something modal."""
    QTest.keyClick(window.windowHandle(), key)


def dialogs(window: OperatorWindow) -> list[QDialog]:
    return [one for one in window.findChildren(QDialog) if one.isVisible()]


@pytest.fixture
def running(open_window: Callable, until: Callable, short_countdown: None) -> OperatorWindow:
    """In the first of two runs, each of a minute unless it is aborted; the participant's window is open."""
    window = open_window(rig={"touch": "sim:", "laser": "sim:", "display": "window"})
    window.resize(740, 560)  # room for a window of the participant's own
    demo = window.space.protocol
    long = demo.runs[1].model_copy(update={"speeds_mm_s": (425.0, 750.0), "duration_s": 60.0})
    window.space.set_protocol(demo.model_copy(update={"runs": (long,), "taps": None, "rest_s": 0.1}))
    window.ask("start")
    until(lambda: window.record._phase is Phase.RECORDING)
    return window


def aborted(window: OperatorWindow, until: Callable) -> bool:
    """Wait for the end of the first run: long before its time, it was aborted."""
    until(lambda: window.record.table.rowCount() == 1)
    return bool(window.record.table.item(0, 5).text() == "✕ aborted")


def test_escape_aborts_the_run_while_a_plot_is_being_saved(running: OperatorWindow, until: Callable) -> None:
    running.record.live.trace._save_as("png")  # returns: nothing waits for the answer
    (dialog,) = dialogs(running)
    assert isinstance(dialog, QFileDialog)
    assert QApplication.activeModalWidget() is None
    press(running.space.recording.window, Key.Key_Escape)
    assert aborted(running, until)
    assert dialog.isVisible()


def test_the_operators_keys_and_buttons_work_next_to_the_dialog(running: OperatorWindow, until: Callable) -> None:
    running.record.live.trace._save_as("png")
    (dialog,) = dialogs(running)
    until(dialog.isActiveWindow)
    press(dialog, Key.Key_F8)
    assert aborted(running, until)
    until(lambda: running.record._phase in (Phase.COUNTDOWN, Phase.RECORDING))
    stop = running.record.buttons["stop"]
    QTest.mouseClick(running.windowHandle(), Qt.MouseButton.LeftButton, pos=stop.mapTo(running, stop.rect().center()))
    until(lambda: not running.space.recording.active)
    press(dialog, Key.Key_Escape)
    assert dialogs(running) == []


def test_escape_aborts_the_run_while_the_window_asks_whether_to_stop(running: OperatorWindow, until: Callable) -> None:
    ended: list[bool] = []

    def answer() -> None:
        box = QApplication.activeModalWidget()
        press(running.space.recording.window, Key.Key_Escape)
        ended.append(aborted(running, until))
        box.reject()

    QTimer.singleShot(0, answer)
    assert not running.close()
    assert ended == [True]


def test_escape_aborts_the_run_while_the_dialog_reports_a_file_that_is_not_there(
    running: OperatorWindow, until: Callable, tmp_path: Path
) -> None:
    running.pages["protocol"][1]._load()
    (dialog,) = dialogs(running)
    dialog.findChild(QLineEdit, "fileNameEdit").setText(str(tmp_path / "none.toml"))

    ended: list[bool] = []

    def answer() -> None:
        box = QApplication.activeModalWidget()
        assert isinstance(box, QMessageBox)
        press(running.space.recording.window, Key.Key_Escape)
        ended.append(aborted(running, until))
        box.reject()

    QTimer.singleShot(0, answer)
    dialog.accept()
    assert ended == [True]


def test_a_new_dialog_takes_the_place_of_the_one_before_and_a_run_closes_it(
    opened: OperatorWindow, until: Callable
) -> None:
    for ask in (files.open_session, files.import_folder, files.write_report, files.export_session):
        ask(opened)
        (dialog,) = dialogs(opened)
    assert dialog.windowTitle() == "Export into which (new or empty) folder?"
    opened.ask("start")
    assert dialogs(opened) == []
    until(lambda: not opened.space.recording.active and not opened.space.tasks.running)


@pytest.mark.parametrize("sure", [True, False])
def test_a_file_is_replaced_only_after_yes(opened: OperatorWindow, until: Callable, tmp_path: Path, sure: bool) -> None:
    path = tmp_path / "curve.csv"
    path.write_text("before")
    plot = opened.pages["results"][1].curve
    plot._save_as("csv")
    (dialog,) = dialogs(opened)
    dialog.setDirectory(str(tmp_path))
    field = dialog.findChild(QLineEdit, "fileNameEdit")
    field.setText("curve.csv")
    QTest.keyClick(field, Key.Key_Return)
    (box,) = dialogs(opened)
    assert isinstance(box, QMessageBox)
    assert "curve.csv exists already" in box.text()
    if sure:
        box.button(QMessageBox.StandardButton.Yes).click()
    else:
        QTest.keyClick(box, Key.Key_Return)  # No is the default
    assert (path.read_text("utf-8") == "before") is not sure
    assert dialogs(opened) == []
