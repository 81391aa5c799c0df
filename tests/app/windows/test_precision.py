"""The precision that the Protocol page promises, against the library's own prediction."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from draglag.analysis.planning import plan
from draglag.protocol.runs import RunPlan
from draglag_app.windows.window import OperatorWindow

SPEEDS = (102.0, 425.0, 1000.0)


def with_circles(window: OperatorWindow, **changes: object) -> None:
    circles = RunPlan.model_validate({"kind": "circle", "speeds_mm_s": SPEEDS, "duration_s": 15.0, **changes})
    space = window.space
    space.change_protocol(space.protocol.model_copy(update={"runs": (circles,), "taps": None}), "edit")


def test_it_is_the_librarys_prediction_and_follows_edits_and_undo(open_window: Callable, until: Callable) -> None:
    window = open_window()
    with_circles(window)
    preview = window.pages["protocol"][1].precision
    window.go("protocol")
    until(lambda: preview.plan is not None)
    expected = plan(window.space.protocol, "screen-1")
    half_ms = 1e3 * np.array([run.half_interval_s for run in expected.runs])
    speed, drawn = preview.plot.drawn["runs"]
    assert sorted(drawn) == sorted(half_ms)
    assert sorted(speed) == list(SPEEDS)
    for run in expected.runs:
        assert f"{run.nominal_speed_mm_s:.0f}:\u00a0{1e3 * run.half_interval_s:.2f}" in preview.words.text()
    assert "at least six" in preview.words.text()

    first = preview.plan
    with_circles(window, duration_s=30.0)
    until(lambda: preview.plan is not first)
    longer = preview.plan
    assert all(b.half_interval_s < a.half_interval_s for a, b in zip(first.runs, longer.runs, strict=True))
    window.ask("undo")
    until(lambda: preview.plan is not longer)
    assert [run.half_interval_s for run in preview.plan.runs] == [run.half_interval_s for run in first.runs]


def test_it_gives_way_to_a_recording_and_needs_no_sight_of_it(open_window: Callable, until: Callable) -> None:
    window = open_window()
    preview = window.pages["protocol"][1].precision
    with_circles(window)
    assert not window.space.quiet_tasks.running
    window.go("protocol")
    until(lambda: bool(window.space.quiet_tasks.running))
    window.ask("start")
    until(lambda: not window.space.quiet_tasks.running)
    assert preview.plan is None


def test_runs_without_edges_are_reported(open_window: Callable, until: Callable) -> None:
    window = open_window()
    with_circles(window, duration_s=2.0, speeds_mm_s=(44.0,))
    preview = window.pages["protocol"][1].precision
    window.go("protocol")
    until(lambda: preview.plan is not None)
    assert "longer" in preview.words.text()
