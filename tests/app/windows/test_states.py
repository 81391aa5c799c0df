"""Lights, titles and numbers mean what they say: ready, recording, ended, simulated, old."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from draglag_app.session.machine import Phase
from draglag_app.windows import files
from draglag_app.windows.window import OperatorWindow


def idle(window: OperatorWindow) -> bool:
    return not window.space.recording.active and not window.space.tasks.running


@pytest.fixture
def in_real_time(open_window: Callable, short_countdown: None) -> OperatorWindow:
    """Two runs of the simulated rig, each of a minute unless it is aborted."""
    window = open_window(rig={"touch": "sim:", "laser": "sim:", "display": "window"})
    runs = [window.space.protocol.runs[1].model_copy(update={"speeds_mm_s": (425.0, 750.0), "duration_s": 60.0})]
    window.space.set_protocol(
        window.space.protocol.model_copy(update={"runs": tuple(runs), "taps": None, "rest_s": 0.1})
    )
    return window


def recording(window: OperatorWindow) -> bool:
    return window.record._phase is Phase.RECORDING


def test_a_start_that_fails_leaves_no_file_name_and_says_so(open_window: Callable, until: Callable) -> None:
    window = open_window(rig={"touch": "evdev:/dev/input/event9999", "laser": "sim:", "display": "offscreen"})
    window.space.set_protocol(window.space.protocol.model_copy(update={"taps": None}))
    window.ask("start")
    until(lambda: idle(window))
    assert window.header.session.text() == "No session"
    assert window.windowTitle() == "draglag"
    assert window.record.big.text() == "Nothing was recorded"
    assert "event9999" in window.record.small.text()
    window.space.change_settings(rig=window.space.settings.rig.model_copy(update={"touch": "sim:"}))
    assert window.record.big.text() == "Ready"  # what went wrong with the other touchscreen is over


def test_it_is_not_ready_while_a_light_is_red(open_window: Callable) -> None:
    window = open_window(rig={"touch": "", "laser": "sim:"})
    assert window.header.lights["touch"].state == "fault"
    assert window.record.big.text().startswith("▲ Not ready: choose touchscreen")
    assert "touchscreen" in window.record.small.text()
    window.space.change_settings(rig=window.space.settings.rig.model_copy(update={"touch": "sim:", "walt": "sim:"}))
    assert window.record.big.text() == "Ready"
    window.header.set_light("laser", "fault", "no light")
    assert window.record.big.text() == "▲ Not ready"
    assert "no light" in window.record.small.text()


@pytest.mark.parametrize("action", ["open_session", "import_folder"])
def test_what_cannot_be_opened_leaves_the_page_as_it_is(
    opened: OperatorWindow, until: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, action: str
) -> None:
    bad = tmp_path / "notes.h5"
    bad.write_text("no session")
    for asked in ("ask_open", "ask_folder"):
        monkeypatch.setattr(files, asked, lambda *args: args[-1](bad))
    opened.go("protocol")
    getattr(files, action)(opened)
    until(lambda: idle(opened))
    assert opened.stack.currentWidget() is opened.pages["protocol"][1]
    assert "notes.h5" in opened.notice_text.text()


def test_closing_the_participants_window_is_said_and_noted(in_real_time: OperatorWindow, until: Callable) -> None:
    window = in_real_time
    window.ask("start")
    until(lambda: recording(window))
    window.space.recording.window.closing.emit()
    until(lambda: window.record.table.rowCount() == 1 and recording(window))
    assert window.record.table.item(0, 5).text() == "✕ aborted"
    assert "somebody closed the participant's window" in window.notice_text.text()
    window.ask("stop")
    until(lambda: idle(window) and window.space.session is not None)
    session = window.space.session
    texts = [entry.text for run in session.runs for entry in run.log] + [note.text for note in session.notes]
    assert any("somebody closed the participant's window" in text for text in texts)


def test_numbers_of_now_go_when_a_session_stops(in_real_time: OperatorWindow, until: Callable) -> None:
    window = in_real_time
    window.ask("start")
    until(lambda: window.record.facts["touch_rate"].value.text().endswith("/s"))
    window.ask("stop")
    until(lambda: idle(window) and window.space.session is not None)
    assert [window.record.facts[name].value.text() for name in ("touch_rate", "touch_age", "edges")] == ["–"] * 3


def test_a_simulated_session_says_so_wherever_it_is_shown(opened: OperatorWindow) -> None:
    assert opened.header.simulated.isVisibleTo(opened)
    assert opened.windowTitle().endswith("SIMULATED")
    measured = opened.space.session.__class__(**{**opened.space.session.__dict__, "devices": {"touch": "evdev:x"}})
    opened.space.take(measured, None)
    assert not opened.header.simulated.isVisibleTo(opened)
    assert "SIMULATED" not in opened.windowTitle()
