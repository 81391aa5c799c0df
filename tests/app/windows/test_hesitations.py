"""What made a new user hesitate (docs/trials-of-use.md): the window says what to do next, and nothing that is over."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QFontMetrics
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QDialog, QFileDialog, QInputDialog, QLabel, QLineEdit, QPushButton, QWidget

from draglag.instruments.calibration import target_places
from draglag.latency import RunEstimate
from draglag.protocol.runs import ClockCheck, TapPlan
from draglag.store import read_session
from draglag_app.windows import start
from draglag_app.windows.pages import bench
from draglag_app.windows.pages.parts.run_table import COMMENT
from draglag_app.windows.parts.theme import apply_theme
from draglag_app.windows.session_dialog import SessionDialog
from draglag_app.windows.settings import CalibrationSettings, PanelSettings, RigSettings
from draglag_app.windows.window import OperatorWindow
from draglag_app.windows.wording.i18n import use_language
from draglag_app.windows.wording.words import latency_text
from draglag_devices.rig import Rig
from draglag_devices.source import Batch, Source, SourceInfo

Key = Qt.Key
FAST = {"touch": "sim:", "laser": "sim:", "walt": "sim:", "fast": True, "display": "offscreen"}


def click(widget: QWidget) -> None:
    QTest.mouseClick(widget, Qt.MouseButton.LeftButton)


def in_sight(parent: QWidget) -> list[str]:
    """Every text of a label or button that is visible."""
    return [one.text() for kind in (QLabel, QPushButton) for one in parent.findChildren(kind) if one.isVisible()]


@pytest.fixture
def dutch_at_150(qapp: QApplication, open_window: Callable) -> OperatorWindow:
    yield open_window(language="nl", text_scale=1.5, rig=RigSettings())
    use_language(qapp, "en")
    apply_theme(qapp, "dark", 1.0)


# --- the bench ---


def test_the_simulated_rig_is_in_every_list_before_devices_are_looked_for(open_window: Callable) -> None:
    window = open_window(rig=RigSettings())
    window.go("bench")
    for box in window.bench.boxes.values():
        assert box.currentText() == ""
        assert [box.itemText(k).split()[0] for k in range(box.count())] == ["sim:"]
        QTest.keyClick(box, Key.Key_Down)
    assert set(window.space.settings.rig.addresses().values()) == {"sim:"}


def test_another_address_takes_back_what_the_check_of_the_last_one_said(
    open_window: Callable, until: Callable, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(bench, "_WATCH_S", 0.3)
    window = open_window(rig={"touch": "sim:", "laser": f"serial:{tmp_path}/ttyACM0?role=laser"})
    window.go("bench")
    click(window.bench.check_button)
    until(lambda: window.bench.check_button.isEnabled() and not window.space.tasks.running)
    assert window.notice_text.text().startswith("Not ready")
    QTest.keyClick(window.bench.boxes["laser"], Key.Key_Down)
    assert not window.notice.isVisible()
    assert window.bench.list.toPlainText() == ""


# --- before a session ---


def test_a_folder_that_cannot_be_written_is_said_where_it_is_entered_and_before_the_start(
    open_window: Callable, qapp: QApplication, tmp_path: Path
) -> None:
    window = open_window()
    window.go("preferences")
    page = window.pages["preferences"][1]
    (line,) = [one for one in page.findChildren(QLineEdit) if one.accessibleName() == "Folder for sessions"]
    (tmp_path / "file").write_text("")
    line.setText(str(tmp_path / "file" / "sessions"))
    QTest.keyClick(line, Key.Key_Return)
    qapp.processEvents()
    assert "choose another folder for sessions" in window.notice_text.text()
    window.go("record")
    assert window.record.big.text() == "▲ Not ready: choose another folder"
    assert "4 Record: choose another folder" in [one.text() for one in window.steps.buttons.values()]
    window.ask("start")
    assert "on the page Preferences" in window.notice_text.text()
    assert not window.space.recording.active
    click(window.record.buttons["mend"])
    assert window.page == "preferences"
    line.setText(str(tmp_path / "sessions"))
    QTest.keyClick(line, Key.Key_Return)
    window.go("record")
    assert window.record.big.text() == "Ready"


def test_session_details_are_in_the_menu_of_the_session_and_say_the_folder(open_window: Callable) -> None:
    window = open_window()
    menu = window.menuBar().actions()[0].menu()
    (details,) = [one for one in menu.actions() if one.text() == "Session details…"]
    details.trigger()
    (dialog,) = window.findChildren(SessionDialog)
    assert any(window.space.settings.folder in text for text in in_sight(dialog))
    dialog.reject()


def test_the_plot_says_that_the_precision_is_being_predicted(open_window: Callable, until: Callable) -> None:
    window = open_window()
    window.go("protocol")
    plot = window.pages["protocol"][1].precision.plot
    until(lambda: "Predicting the precision…" in in_sight(plot))
    until(lambda: "Predicting the precision…" not in in_sight(plot))


def test_a_perfect_calibration_is_not_drawn_longer_without_end(open_window: Callable, qapp: QApplication) -> None:
    screen = PanelSettings().screen()
    x, y = target_places(screen.width_mm, screen.height_mm, 9)
    made = CalibrationSettings(address="sim:", x_raw=tuple(20 * x), y_raw=tuple(20 * y))
    window = open_window(panel=PanelSettings(calibration=made))
    window.go("geometry")
    qapp.processEvents()
    (title,) = [one for one in window.geometry_page.calibration.picture.drawn if one.startswith("residuals ×")]
    assert float(title.split("×")[1]) <= 5000


# --- while it is recorded ---


class Dark:
    """A laser whose beam is never blocked."""

    def __init__(self, inner: Source) -> None:
        self.inner = inner
        self.address, self.role, self.realtime = inner.address, inner.role, inner.realtime

    def open(self) -> SourceInfo:
        return self.inner.open()

    def read(self, timeout_s: float) -> Batch:
        return replace(self.inner.read(timeout_s), laser=None)

    def close(self) -> None:
        self.inner.close()


def test_a_beam_that_is_never_blocked_is_said_during_the_run_and_in_its_verdict(
    open_window: Callable, until: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = start.make_rig

    def dark(*asked: object) -> Rig:
        rig = made(*asked)
        return Rig(tuple(Dark(one) if one.role == "laser" else one for one in rig.sources), rig.stage)

    monkeypatch.setattr(start, "make_rig", dark)
    window = open_window(rig=FAST)
    run = window.space.protocol.runs[0].model_copy(update={"speeds_mm_s": (240.0,), "duration_s": 12.0})
    plan = {"runs": (run,), "taps": None, "clock_check": None}
    window.space.set_protocol(window.space.protocol.model_copy(update=plan))
    said = []
    window.space.bridge.notice_raised.connect(lambda notice: said.append(notice.text))
    window.ask("start")
    until(lambda: window.space.session is not None and not window.space.tasks.running)
    rows = window.record.table.rowCount()
    assert rows > 1  # it comes again
    assert {window.record.table.item(row, 5).text() for row in range(rows)} == {"✕ no edges"}
    assert len([text for text in said if "the laser saw nothing" in text]) == rows  # once a run


def test_a_rest_names_what_comes_next_and_offers_no_run_again_after_taps(
    open_window: Callable, until: Callable
) -> None:
    window = open_window(rig=FAST, begin_by_hand=True)
    run = window.space.protocol.runs[1].model_copy(update={"speeds_mm_s": (425.0,), "duration_s": 10.0})
    plan = {
        "runs": (run,),
        "taps": TapPlan(count=4, interval_s=1.0),
        "clock_check": ClockCheck(duration_s=100.0),
        "rest_s": 0.0,
    }
    window.space.set_protocol(window.space.protocol.model_copy(update=plan))
    line, repeat = window.record.small, window.record.buttons["repeat"]
    window.ask("start")
    for said in ("the first run now", "the taps now, F7 repeats the last run", "the comparison of the clocks now"):
        until(lambda said=said: line.text().endswith(f"F6 begins {said}"))
        assert repeat.isEnabled() == ("F7" in said)
        last = line.text()
        window.ask("proceed")
    assert last.startswith("1:40 left in the session")  # the taps are done
    until(lambda: window.space.analysis is not None and not window.space.tasks.running)


def test_no_interval_is_written_as_zero() -> None:
    one = RunEstimate("run-01", "circle", 600.0, "kernel", latency_s=0.03)
    written = {half_ms: latency_text(replace(one, latency_ci95_s=(0.03 - half_ms / 1e3, 0.03 + half_ms / 1e3)))
               for half_ms in (0.1, 0.04, 0.001)}  # fmt: skip
    assert written == {0.1: "30.0 ± 0.1 ms", 0.04: "30.00 ± 0.04 ms", 0.001: "30.00 ± 0.01 ms"}


# --- large letters ---


def test_the_largest_letters_give_way_before_they_are_cut_off(dutch_at_150: OperatorWindow, qapp: QApplication) -> None:
    window = dutch_at_150
    window.go("record")
    window.resize(1280, 800)
    window.record.set_recording(True)
    window.record.band.enable(resting=True, running=False, any_run=True)
    sizes = []
    for text in ("✕ afgebroken", "Rust"):
        window.record.band.say(text, "", "bad")
        qapp.processEvents()
        assert window.record.big.shown() == text
        sizes.append(window.record.big.fontMetrics().height())
    assert sizes[0] < sizes[1]
    window.record.set_recording(False)


def test_a_step_has_the_room_that_its_words_need(dutch_at_150: OperatorWindow, qapp: QApplication) -> None:
    window = dutch_at_150
    window.go("bench")
    window.resize(1280, 800)
    qapp.processEvents()
    for step in window.steps.buttons.values():
        assert QFontMetrics(step.font()).horizontalAdvance(step.text()) <= step.width(), step.text()


# --- afterwards ---


def test_a_session_is_named_in_the_language_of_the_window_and_keeps_its_name(
    qapp: QApplication, open_window: Callable, until: Callable
) -> None:
    try:
        window = open_window(rig=FAST, language="nl")
        run = window.space.protocol.runs[1].model_copy(update={"speeds_mm_s": (425.0,), "duration_s": 10.0})
        plan = {"name": "quick", "runs": (run,), "taps": None, "clock_check": None}
        window.space.set_protocol(window.space.protocol.model_copy(update=plan))
        window.ask("start")
        until(lambda: window.space.analysis is not None and not window.space.tasks.running)
        assert read_session(window.space.path).name == "quick op screen-1"
        use_language(qapp, "en")
        assert window.space.session.name == "quick op screen-1"
    finally:
        use_language(qapp, "en")


def test_a_comment_is_brought_in_sight(opened: OperatorWindow, qapp: QApplication) -> None:
    window = opened
    window.go("results")
    window.resize(1000, 800)
    qapp.processEvents()
    table = window.pages["results"][1].table
    table.select("run-02")
    click(window.pages["results"][1].comment)
    (dialog,) = window.findChildren(QInputDialog)
    QTest.keyClicks(dialog.findChild(QLineEdit), "fine")
    QTest.keyClick(dialog, Key.Key_Return)
    qapp.processEvents()
    (cell,) = [table.item(row, COMMENT) for row in range(table.rowCount()) if table.item(row, COMMENT).text()]
    assert np.sign(table.visualItemRect(cell).width())
    assert table.viewport().rect().intersects(table.visualItemRect(cell))


@pytest.mark.parametrize(("action", "title"), [("netcdf", "Export netCDF"), ("mat", "Export MATLAB")])
def test_the_dialog_of_an_export_names_its_format(opened: OperatorWindow, action: str, title: str) -> None:
    opened.ask(action)
    (dialog,) = [one for one in opened.findChildren(QDialog) if one.isVisible()]
    assert isinstance(dialog, QFileDialog)
    assert dialog.windowTitle() == title
    dialog.reject()


def test_a_wrong_diameter_of_the_stylus_is_named_where_the_gap_is_as_wide_as_it() -> None:
    from draglag.simulation.effects import EFFECTS

    for effect in ("beam_width", "scale_error"):
        assert "wrong diameter" in EFFECTS[effect].separated_by
