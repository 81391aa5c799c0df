"""Before a measurement: what the steps and the Record page say is missing, and the buttons that mend it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from draglag.protocol.presets import load_screen_file
from draglag.protocol.runs import expand, first_target_after_s, load_protocol
from draglag.recording import Screen
from draglag.store import read_session
from draglag_app.cli.record import session_options
from draglag_app.session import OffscreenDisplay, run_session
from draglag_app.windows.session_dialog import SessionDialog
from draglag_app.windows.settings import RigSettings, load_settings
from draglag_app.windows.start import make_order
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
    assert all(text.startswith("✓") for text in texts(window).values())
    window.go("record")
    assert not mend.isVisible()
    window.go("results")
    assert not window.steps.isVisible()


def test_every_preset_has_its_sentence_and_says_when_its_first_target_moves(open_window: Callable) -> None:
    window = open_window()
    page = window.pages["protocol"][1]
    tips = {action.text(): action.toolTip() for action in page.preset.menu().actions()}
    for name in presets("protocols"):
        protocol = load_protocol(name)
        window.space.set_protocol(protocol)
        assert page.meaning.text() == protocol.description
        assert protocol.description.split(":")[0] in tips[name]
        said = window.record.small.text()
        if not protocol.runs:
            assert "first target" not in said
            continue
        seconds = round(first_target_after_s(protocol, 3.0))
        assert f"the first target moves after {seconds // 60}:{seconds % 60:02d}" in said


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

    def test_a_template_that_cannot_be_is_refused_in_sight(self, open_window: Callable) -> None:
        window = open_window()
        dialog = self.dialog(window)
        dialog.template.setText("{nobody}")
        assert "{nobody}" in dialog.preview.text()
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
        dialog.reject()
        assert not window.space.recording.active
