"""The line below the largest letters: how long the session lasts, and what comes next, in as many words as fit."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

import pytest
from PySide6.QtWidgets import QApplication

from draglag.latency import RunEstimate
from draglag.latency.flags import MEANING
from draglag_app.session.machine import Phase
from draglag_app.windows.pages.parts.between_runs import verdict_words
from draglag_app.windows.window import OperatorWindow
from draglag_app.windows.wording.i18n import use_language

RUN_S, REST_S = 60.0, 600.0


@pytest.fixture
def two_runs(open_window: Callable) -> OperatorWindow:
    """Two runs of a minute, in real time, with a long rest."""
    window = open_window(rig={"touch": "sim:", "laser": "sim:", "display": "offscreen"})
    run = window.space.protocol.runs[1].model_copy(update={"speeds_mm_s": (425.0, 600.0), "duration_s": RUN_S})
    plan = window.space.protocol.model_copy(update={"runs": (run,), "taps": None, "rest_s": REST_S})
    window.space.set_protocol(plan)
    return window


def left_s(window: OperatorWindow) -> int:
    """What the line says is left in the session."""
    found = re.search(r"(\d+):(\d\d) left in the session", window.record.small.text())
    assert found, window.record.small.text()
    return 60 * int(found[1]) + int(found[2])


def abort_in(window: OperatorWindow, phase: Phase, until: Callable) -> None:
    """Begin the next run, abort it in that phase, and wait for the rest."""
    rows = window.record.table.rowCount()
    window.ask("proceed")
    until(lambda: window.record._phase is phase)
    window.ask("abort")
    until(lambda: window.record.table.rowCount() > rows and window.record.buttons["proceed"].isVisible())
    until(lambda: window.record.big.text() == "✕ aborted")


def test_the_time_left_counts_the_run_that_is_about_to_start_and_no_run_twice(
    two_runs: OperatorWindow, until: Callable
) -> None:
    window = two_runs
    window.ask("start")
    until(lambda: window.record._phase is Phase.COUNTDOWN)
    assert left_s(window) > 2 * RUN_S + REST_S
    abort_in(window, Phase.COUNTDOWN, until)
    abort_in(window, Phase.COUNTDOWN, until)
    window.ask("proceed")
    until(lambda: window.record._phase is Phase.RECORDING)
    assert "repeated" in window.record.small.text()  # the first of the two that were aborted
    assert left_s(window) < 2 * RUN_S + 1.1 * REST_S
    window.ask("stop")
    until(lambda: not window.space.recording.active)


def test_a_rest_says_first_how_long_it_lasts_and_last_what_buttons_say_too(
    two_runs: OperatorWindow, until: Callable
) -> None:
    window = two_runs
    window.ask("start")
    until(lambda: window.record._phase is Phase.COUNTDOWN)
    assert window.record.progress.isVisible()
    window.ask("abort")
    until(lambda: window.record.big.text() == "✕ aborted")
    assert not window.record.progress.isVisible()  # its room is that of the words
    parts = window.record.small.text().split(" · ")
    assert re.fullmatch(r"Rest \d+:\d\d", parts[0])
    assert parts[1] == "recorded again at the end; Ctrl+Z cancels that"
    assert parts[2].endswith("left in the session")
    assert "left in the session" in window.record.small.shown()
    window.ask("undo")
    until(lambda: "recorded again" not in window.record.small.text())
    assert window.space.recording.control.queued == ()
    window.ask("stop")
    until(lambda: not window.space.recording.active)


def rest_left_s(window: OperatorWindow) -> int:
    """What the line says is left of the rest."""
    found = re.match(r"Rest (\d+):(\d\d)", window.record.small.text())
    assert found, window.record.small.text()
    return 60 * int(found[1]) + int(found[2])


def test_a_rest_counts_down_with_the_time_left_in_the_session_below_the_verdict(
    two_runs: OperatorWindow, until: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = two_runs
    window.ask("start")
    until(lambda: window.record._phase is Phase.COUNTDOWN)
    window.ask("abort")
    until(lambda: window.record.big.text() == "✕ aborted" and "Rest " in window.record.small.text())
    now_s, drawn = [time.monotonic()], []
    monkeypatch.setattr("draglag_app.windows.pages.record.time", SimpleNamespace(monotonic=lambda: now_s[0]))
    window.record.live.drawing.connect(lambda: drawn.append(now_s[0]))
    until(lambda: bool(drawn))
    before_s = rest_left_s(window), left_s(window)
    assert before_s[0] < REST_S + 1
    for after_s in (1.0, 7.0, 100.0):
        now_s[0] = drawn[0] + after_s
        until(lambda: drawn[-1] == now_s[0])
        assert (rest_left_s(window), left_s(window)) == (before_s[0] - after_s, before_s[1] - after_s)
        assert window.record.big.shown() == "✕ aborted"
        assert window.record.big.fontMetrics().height() > 1.8 * window.record.small.fontMetrics().height()
    window.ask("stop")
    until(lambda: not window.space.recording.active)


ONE = RunEstimate("run-01", "circle", 600.0, "kernel", latency_s=0.04, latency_se_s=5e-4, flags=("few_edges",))


def test_a_good_run_says_its_latency_and_one_with_flags_names_them_all() -> None:
    good = replace(ONE, flags=(), latency_s=0.0387, latency_ci95_s=(0.0386, 0.0388))
    several = replace(ONE, flags=("few_edges", "off_speed"))
    four = replace(ONE, latency_s=None, flags=("few_edges", "unidentifiable", "little_travel", "alias"))
    assert verdict_words(good, preliminary=False) == ("good", "✓ 38.7 ± 0.1 ms", "")
    practised = replace(good, flags=("practice", "few_edges"))
    assert verdict_words(practised, preliminary=False) == ("", "practice: 38.7 ± 0.1 ms", "")
    assert verdict_words(ONE, preliminary=False) == ("warning", "▲ few edges: repeat? F7", "")
    assert verdict_words(several, preliminary=False) == ("warning", "▲ few edges, off speed", "")
    assert verdict_words(four, preliminary=False, queued=True) == (
        "bad",
        "✕ few edges and 3 more",
        "also unidentifiable, little travel, alias · recorded again at the end; Ctrl+Z cancels that",
    )


@pytest.mark.parametrize("language", ["en", "nl"])
def test_the_largest_letters_are_whole_whatever_the_flags(
    open_window: Callable, qapp: QApplication, language: str
) -> None:
    flags = tuple(MEANING)
    try:
        window = open_window(language=language)
        window.go("record")
        window.resize(1280, 800)
        window.record.set_recording(True)
        window.record.band.enable(resting=True, running=False, any_run=True)
        for k in range(len(flags)):
            for n in (1, 2, 4):
                found = replace(ONE, latency_s=None, flags=(flags + flags)[k : k + n])
                level, large, more = verdict_words(found, preliminary=False)
                window.record.band.say(large, more, level)
                qapp.processEvents()
                assert window.record.big.shown() == large
        window.record.set_recording(False)
    finally:
        use_language(qapp, "en")
