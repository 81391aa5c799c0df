"""Before a measurement: what the steps and the Record page say is missing, and the buttons that mend it."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import h5py
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from draglag.protocol.presets import load_screen_file
from draglag.protocol.runs import expand, first_target_after_s, load_protocol
from draglag.recording import Screen
from draglag.store import read_session
from draglag_app.cli.record import session_options
from draglag_app.preflight import Check
from draglag_app.session import OffscreenDisplay, run_session
from draglag_app.windows.pages import bench
from draglag_app.windows.session_dialog import SessionDialog
from draglag_app.windows.settings import RigSettings, load_settings
from draglag_app.windows.start import make_order, obstacles
from draglag_app.windows.window import OperatorWindow
from draglag_devices.rig import make_rig
from draglag_resources import presets


def texts(window: OperatorWindow) -> dict[str, str]:
    return {page: made.text() for page, made in window.steps.buttons.items()}


def test_steps_say_what_is_missing_and_lead_there(open_window: Callable[..., OperatorWindow]) -> None:
    window = open_window(rig=RigSettings())
    window.go("record")
    assert texts(window) == {
        "bench": "1 Bench: choose touchscreen and laser", "geometry": "✓ Geometry", "protocol": "✓ Protocol",
        "record": "4 Record: waits for the steps before",
    }  # fmt: skip
    assert "choose touchscreen and laser" in window.record.big.text()
    mend = window.record.buttons["mend"]
    assert mend.isVisible()
    QTest.mouseClick(mend, Qt.MouseButton.LeftButton)
    assert window.page == "bench"
    window.space.change_settings(rig=RigSettings(touch="sim:", laser="sim:"))
    assert texts(window)["bench"] == "1 Bench: choose a WALT for the taps"
    QTest.mouseClick(window.steps.buttons["protocol"], Qt.MouseButton.LeftButton)
    assert window.page == "protocol"
    window.space.set_protocol(load_protocol("quick"))
    assert [text[0] for text in texts(window).values()] == ["✓", "✓", "✓", "4"]
    assert texts(window)["record"] == "4 Record: press Start"  # nothing has been recorded yet
    window.go("record")
    assert not mend.isVisible()
    window.go("results")
    assert not window.steps.isVisible()


def test_every_preset_has_its_sentence_and_says_when_its_first_target_moves(open_window: Callable) -> None:
    window = open_window()
    page = window.pages["protocol"][1]
    menu = page.preset.menu()
    menu.popup(QPoint(0, 0))
    entries = {action.text().split(":")[0]: action for action in menu.actions()}
    menu.close()
    for name in presets("protocols"):
        protocol = load_protocol(name)
        window.space.set_protocol(protocol)
        assert page.meaning.text() == protocol.description
        assert protocol.description.split(":")[0] in entries[name].toolTip()
        sentence, duration = entries[name].text().removeprefix(f"{name}: ").split("\t")
        assert protocol.description.startswith(sentence.removesuffix("…"))
        assert len(sentence) > 40
        assert f"about {duration.removesuffix(' min')} in all" in page.preview.words.text()
        said = window.record.small.text()
        if not protocol.runs:
            assert "first target" not in said
            continue
        seconds = round(first_target_after_s(protocol, 3.0))
        assert f"the first target moves after {seconds // 60}:{seconds % 60:02d}" in said


def test_runs_that_wait_for_a_key_say_when_the_first_target_moves_only_where_no_rest_is_before_it(
    open_window: Callable,
) -> None:
    window = open_window(begin_by_hand=True)
    quick, check = load_protocol("quick"), load_protocol("demo").clock_check
    window.space.set_protocol(quick)
    assert "first target moves after 0:03" in window.record.small.text()
    window.space.set_protocol(quick.model_copy(update={"clock_check": check}))
    assert "first target" not in window.record.small.text()


def test_a_simulated_screen_needs_not_have_the_shape_of_the_one_that_shows_it(open_window: Callable) -> None:
    window = open_window(rig={"touch": "sim:", "laser": "sim:", "walt": "sim:", "display": "screen 1"})
    assert not [one for one in obstacles(window.space) if one.page == "geometry"]


def test_a_check_says_that_all_is_well_and_other_settings_leave_what_it_found(
    open_window: Callable, until: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = {"touch": "evdev:/dev/input/event5", "laser": "ethercat:eth9", "display": "window"}
    window = open_window(rig=rig)
    window.space.set_protocol(load_protocol("quick"))
    found = [Check(role, "ok", "answers") for role in ("touch", "laser")]
    monkeypatch.setattr(bench, "check_devices", lambda *asked: found)
    window.ask("check")
    until(lambda: "every instrument answers" in window.notice_text.text())
    window.space.change_settings(sound=True)
    window.space.set_protocol(load_protocol("demo"))
    lights = (window.header.lights, window.bench.lights)
    assert [one[role].state for one in lights for role in ("touch", "laser")] == ["ready"] * 4
    window.space.change_settings(rig=window.space.settings.rig.model_copy(update={"laser": "ethercat:eth8"}))
    assert [one["laser"].state for one in lights] == ["warning"] * 2


def test_a_recording_begins_when_it_was_predicted(tmp_path: Path) -> None:
    quick, demo = load_protocol("quick"), load_protocol("demo")
    taps = demo.taps.model_copy(update={"count": 5, "when": "start"})
    plan = quick.model_copy(update={"runs": quick.runs[:1], "taps": taps, "clock_check": demo.clock_check})
    rig = make_rig({"touch": "sim:", "laser": "sim:", "walt": "sim:"}, "screen-1", 1, fast=True)
    options = session_options(rig, "screen-1", None)
    session = read_session(run_session(plan, rig, OffscreenDisplay(), tmp_path / "s.h5", options))
    foretold_s = first_target_after_s(plan, options.countdown_s)
    # Whoever taps in time is waited for a second longer, and the clocks are compared in between.
    assert 0.0 <= session.runs[0].start_s - session.started_s - foretold_s < 3.0


def test_the_quick_protocol_takes_two_minutes() -> None:
    protocol, preset = load_protocol("quick"), load_screen_file("screen-1")
    plan = expand(protocol, Screen(preset.name, **preset.screen.model_dump()))
    assert sum(run.duration_s + protocol.rest_s + 3.0 for run in plan) <= 120.0
    assert len(plan) >= 5


class TestDetails:
    def dialog(self, window: OperatorWindow) -> SessionDialog:
        window.ask("details")
        QApplication.processEvents()
        dialog = window.findChild(SessionDialog)
        assert dialog is not None
        return dialog

    def test_what_is_entered_reaches_order_header_and_settings(self, open_window: Callable) -> None:
        window = open_window()
        dialog = self.dialog(window)
        dialog.participant.setText("P07")
        dialog.session.setText("2")
        dialog.more.click()
        dialog.free[0][0].setText("hand")
        dialog.free[0][1].setText("left")
        dialog.template.setText("{participant}-{session}-{hand}")
        assert "P07-2-left.h5" in dialog.preview.text()
        dialog._keep()
        order = make_order(window.space)
        assert order.options.details == {"participant": "P07", "session": "2", "hand": "left"}
        assert order.out.name == "P07-2-left.h5"
        assert "participant: P07" in window.record.about.text()
        kept, problem = load_settings(window.space.settings_file)
        assert not problem
        assert kept.details() == order.options.details

    def test_all_of_it_ends_in_the_file_the_header_and_the_report(
        self, open_window: Callable, until: Callable, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
    ) -> None:
        window = open_window()
        protocol = window.space.protocol
        window.space.set_protocol(protocol.model_copy(update={"runs": protocol.runs[:1], "taps": None}))
        given = {"participant": "P07", "session": "morning 2", "operator": "Zoë", "hand": "left"}
        dialog = self.dialog(window)
        dialog.screen_box.setCurrentIndex(dialog.screen_box.findData("screen-2"))
        dialog.more.click()
        fields = (dialog.participant, dialog.session, dialog.operator, dialog.free[0][1])
        for line, text in zip(fields, given.values(), strict=True):
            line.insert(text)
        dialog.free[0][0].insert("hand")
        dialog.template.setText("{screen}_{participant}_{session}_{operator}_{hand}")
        QTest.mouseClick(dialog.buttons.button(dialog.buttons.StandardButton.Ok), Qt.MouseButton.LeftButton)
        in_header: list[str] = []
        window.space.bridge.run_started.connect(lambda event: in_header.append(window.header.session.text()))
        window.ask("start")
        until(lambda: window.space.analysis is not None and not window.space.tasks.running)
        path = window.space.path
        assert path.name == "screen-2_P07_morning_2_Zoë_left.h5"
        with h5py.File(path) as file:
            assert {name: value.decode() for name, value in file["details"].attrs.items()} == given
            assert file["screen"].attrs["name"].decode() == "screen-2"
        folder = tmp_path / "report"
        monkeypatch.setattr("draglag_app.windows.files.ask_new_folder", lambda *asked: asked[-1](folder))
        window.ask("report")
        until((folder / "report.html").is_file)
        until(lambda: not window.space.tasks.running)
        report = re.sub("<[^>]*>", " ", (folder / "report.html").read_text("utf-8"))
        for text in ("screen-2", *given.values()):
            assert text in in_header[0].partition(" · ")[2]  # behind the file's name, while it is recorded
            assert text in window.header.session.text().partition(" · ")[2]
            assert text in report

    def test_a_template_that_cannot_be_is_refused_in_sight(self, open_window: Callable) -> None:
        window = open_window()
        dialog = self.dialog(window)
        dialog.template.setText("{nobody}")
        assert "{nobody}" in dialog.preview.text()
        assert "{participant} {session} {operator} {date} {time} {protocol} {screen}" in dialog.known.text()
        assert not dialog.buttons.button(dialog.buttons.StandardButton.Ok).isEnabled()
        before = window.space.settings
        dialog.reject()
        assert window.space.settings == before

    def test_it_is_asked_before_every_session_where_wanted(self, open_window: Callable) -> None:
        window = open_window(ask_details=True)
        window.start()
        dialog = window.findChild(SessionDialog)
        assert dialog is not None
        assert not window.space.recording.active
        assert dialog.buttons.button(dialog.buttons.StandardButton.Ok).text() == "Start"
        dialog.reject()
        assert not window.space.recording.active
