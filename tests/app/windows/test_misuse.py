"""Whatever goes wrong or is pressed at the wrong time: one sentence, nothing lost, and the window goes on."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from PySide6.QtCore import Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QMessageBox

from app.session_rigs import DiesAt, of_role, replaced
from draglag.store import read_session
from draglag_app.session.machine import Phase
from draglag_app.windows import start
from draglag_app.windows.window import OperatorWindow


def phase(window: OperatorWindow) -> Phase | None:
    return window.record._phase


def idle(window: OperatorWindow) -> bool:
    return not window.space.recording.active and not window.space.tasks.running


@pytest.fixture
def in_real_time(open_window: Callable) -> OperatorWindow:
    """On the simulated rig in real time, with two runs just long enough for a latency."""
    window = open_window(rig={"touch": "sim:", "laser": "sim:", "display": "window"})
    runs = [window.space.protocol.runs[1].model_copy(update={"speeds_mm_s": (425.0, 750.0), "duration_s": 4.0})]
    window.space.set_protocol(
        window.space.protocol.model_copy(update={"runs": tuple(runs), "taps": None, "rest_s": 0.1})
    )
    return window


def test_a_sensor_unplugged_in_a_run_is_reported_and_the_run_before_it_is_kept(
    open_window: Callable, until: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_window()

    def order(space: object) -> object:
        made = start.make_order(space)
        rig = replaced(made.rig, DiesAt(of_role(made.rig, "laser"), 50.0))  # in the second run
        return type(made)(**{**made.__dict__, "rig": rig})

    monkeypatch.setattr("draglag_app.windows.beginning.make_order", order)
    window.ask("start")
    until(lambda: window.space.session is not None and idle(window))
    assert [run.outcome for run in window.space.session.runs] == ["complete", "device_lost"]
    assert "plug it in" in window.notice_text.text()
    assert window.record.table.item(1, 5).text().startswith("✕")
    assert window.space.analysis.runs[0].latency_s is not None
    # All can be started again.
    monkeypatch.undo()
    assert window.actions_table.made["start"].isEnabled()
    window.ask("start")
    until(lambda: idle(window) and len(window.space.session.runs) > 2)


def test_keys_at_the_wrong_time_do_nothing_that_matters(in_real_time: OperatorWindow, until: Callable) -> None:
    window = in_real_time
    for action in ("proceed", "repeat", "abort", "stop", "note", "undo", "redo", "cancel"):
        window.ask(action)  # before anything runs
    window.ask("start")
    until(lambda: phase(window) is Phase.COUNTDOWN)
    window.start()
    assert "already" in window.notice_text.text()
    window.ask("abort")
    until(lambda: window.record.table.rowCount() == 1)
    assert window.record.table.item(0, 5).text() == "✕ aborted"
    until(lambda: phase(window) is Phase.RECORDING)
    for action in ("theme", "theme", "proceed", "undo", "redo", "open", "check", "calibrate", "analyse", "cancel"):
        window.ask(action)
    window.pages["preferences"][1].language.setCurrentIndex(2)
    window.pages["preferences"][1].language.activated.emit(2)
    until(lambda: window.space.session is not None and idle(window))
    # What was aborted comes again at the end.
    assert [(run.id, run.outcome) for run in window.space.session.runs] == [
        ("run-01", "aborted"), ("run-02", "complete"), ("run-01-2", "complete"),
    ]  # fmt: skip
    assert [estimate.id for estimate in window.space.live.known] == ["run-02", "run-01-2"]


@pytest.mark.usefixtures("short_countdown")
def test_closing_in_a_run_asks_and_return_means_go_on(in_real_time: OperatorWindow, until: Callable) -> None:
    window = in_real_time
    window.ask("start")
    until(lambda: phase(window) is Phase.RECORDING)
    asked: list[str] = []

    def press(key: Qt.Key) -> None:
        box = QApplication.activeModalWidget()
        assert isinstance(box, QMessageBox)
        asked.append(box.text())
        QTest.keyClick(box, key)

    for key in (Qt.Key.Key_Return, Qt.Key.Key_Escape):
        QTimer.singleShot(0, lambda key=key: press(key))
        assert not window.close()
    assert len(asked) == 2
    assert window.isVisible()
    until(lambda: window.space.session is not None and idle(window))
    assert [run.outcome for run in window.space.session.runs] == ["complete", "complete"]


def test_a_folder_that_cannot_be_written_is_reported_and_start_stays(open_window: Callable, tmp_path: Path) -> None:
    window = open_window()
    (tmp_path / "file").write_text("")
    window.space.change_settings(folder=str(tmp_path / "file" / "sessions"))
    window.ask("start")
    assert "Nothing can be saved" in window.notice_text.text()
    assert not window.space.recording.active
    assert window.record.buttons["start"].isVisible()


@pytest.mark.parametrize("content", [b"", b"not HDF5", bytes(range(256)) * 40])
def test_a_file_that_is_no_session_leaves_the_one_at_hand(
    opened: OperatorWindow, until: Callable, tmp_path: Path, content: bytes
) -> None:
    before, bad = opened.space.session, tmp_path / "bad.h5"
    bad.write_bytes(content)
    opened.space.open(bad)
    until(lambda: not opened.space.tasks.running)
    assert "bad.h5" in opened.notice_text.text()
    assert opened.space.session is before
    assert opened.space.analysis is not None


def test_a_note_of_any_length_is_kept(in_real_time: OperatorWindow, until: Callable) -> None:
    window = in_real_time
    window.ask("start")
    until(lambda: phase(window) is Phase.COUNTDOWN)
    window.ask("note")
    window.record.note.setText("Ωé" * 10_000)
    QTest.keyClick(window.record.note, Qt.Key.Key_Return)
    until(lambda: window.space.session is not None and idle(window))
    session = read_session(window.space.path)
    texts = [entry.text for run in session.runs for entry in run.log] + [entry.text for entry in session.notes]
    assert "Ωé" * 10_000 in texts


def test_what_a_plot_can_do_is_there_for_the_keyboard(opened: OperatorWindow, until: Callable) -> None:
    opened.go("results")
    plot = opened.pages["results"][1].curve
    plot.setFocus()
    opened.activateWindow()
    until(opened.isActiveWindow)
    QTest.keyClick(plot, Qt.Key.Key_Return)
    until(lambda: QApplication.activePopupWidget() is not None)
    menu = QApplication.activePopupWidget()
    assert menu is not None
    assert len(menu.actions()) == 6
    for _ in range(3):
        QTest.keyClick(menu, Qt.Key.Key_Down)
    QTest.keyClick(menu, Qt.Key.Key_Return)
    assert QApplication.clipboard().text().startswith("series,drag speed (mm/s),latency (ms)")
