"""Sessions too poor to judge: a plain statement of what is missing, never a verdict and never an exception."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.strokes import even_strokes
from draglag.errors import EstimateError
from draglag.gap import GapReport, close_gap, find
from draglag.gap.session_check import what_is_missing
from draglag.protocol.runs import load_protocol
from draglag.recording import Run, Session
from draglag.simulation import rig_for_screen, simulate_session


@pytest.fixture(scope="module")
def sound() -> Session:
    demo = load_protocol("demo")
    runs = tuple(r.model_copy(update={"duration_s": 12.0}) for r in demo.runs if r.kind == "circle")
    return simulate_session("screen-1", demo.model_copy(update={"runs": runs, "taps": None}), seed=4)


def of_runs(session: Session, change) -> Session:  # type: ignore[no-untyped-def]
    return replace(session, runs=tuple(change(run) for run in session.runs))


def touch_times(run: Run, change) -> Run:  # type: ignore[no-untyped-def]
    return replace(run, touch=replace(run.touch, t_s=change(run.touch.t_s)))


def laser(run: Run, **changed: np.ndarray) -> Run:
    return replace(run, laser=replace(run.laser, **changed))


def test_one_of_a_thing_is_reported_in_the_singular(sound: Session) -> None:
    fastest = max(sound.runs, key=lambda run: run.nominal_speed_mm_s or 0.0)
    missing = close_gap(replace(sound, runs=(fastest,))).missing
    assert "1 run at an even speed with edges: at least 5 are needed" in missing
    assert "1 drag speed: at least 4, spread over a factor of 3, are needed" in missing


def test_many_speeds_that_are_too_near_each_other_are_reported_by_their_factor(sound: Session) -> None:
    near = [run for run in sound.runs if 100 < (run.nominal_speed_mm_s or 0) < 260]
    speeds = [run.nominal_speed_mm_s for run in near if run.nominal_speed_mm_s]
    near.append(replace(near[0], id="run-99"))  # five runs are needed, too
    (missing,) = close_gap(replace(sound, runs=tuple(near))).missing
    factor = max(speeds) / min(speeds)
    assert missing == f"drag speeds within a factor of {factor:.1f}: they have to spread over one of 3"


def test_times_that_are_no_numbers_or_go_back_are_reported_by_run(sound: Session) -> None:
    def holed(t_s: np.ndarray) -> np.ndarray:
        return np.where(np.arange(t_s.size) % 50 == 7, np.nan, t_s)

    for change in (holed, lambda t_s: t_s[::-1]):
        poor = of_runs(sound, lambda run, change=change: touch_times(run, change))
        report = close_gap(poor)
        assert report.verdict is None
        assert len(report.missing) == 1
        first = ", ".join(run.id for run in sound.runs[:3])
        assert report.missing[0].startswith(f"touch times of {first} and {len(sound.runs) - 3} more go back or are no")
        with pytest.raises(EstimateError, match="touch times of"):
            find(poor)


def test_streams_on_two_clocks_are_reported_as_such(sound: Session) -> None:
    report = close_gap(of_runs(sound, lambda run: laser(run, t_s=run.laser.t_s - 1.7e9)))
    assert report.verdict is None
    n = len(sound.runs)
    assert report.missing == (
        f"edges and touch events of {n} of {n} runs at an even speed lie at different times: both have to be on "
        "one clock",
    )


def test_edges_that_give_no_latency_are_not_blamed_on_the_speeds(sound: Session) -> None:
    report = close_gap(of_runs(sound, lambda run: laser(run, light=1 - run.laser.light)))
    assert report.verdict is None
    said = "runs that give a latency: 0, at least 5 are needed. See with draglag analyze why the others give none"
    assert report.missing[0].startswith(said)


@pytest.fixture(scope="module")
def report(sound: Session) -> GapReport:
    return close_gap(sound, max_effects=0)


def test_a_sound_session_misses_nothing(report: GapReport) -> None:
    assert report.missing == ()


def test_a_run_of_which_touch_saw_next_to_nothing_costs_only_itself(sound: Session, report: GapReport) -> None:
    touch = sound.runs[0].touch
    few = replace(
        touch, t_s=touch.t_s[:20], x_mm=touch.x_mm[:20], y_mm=touch.y_mm[:20], contact_id=touch.contact_id[:20]
    )
    other = close_gap(replace(sound, runs=(replace(sound.runs[0], touch=few), *sound.runs[1:])), max_effects=0)
    assert other.verdict == report.verdict


def test_what_free_drags_miss_is_said_without_circles(sound: Session) -> None:
    rig = rig_for_screen("screen-1")
    drags = tuple(even_strokes(rig, v, 120.0, run_id=f"free-{v:.0f}")[0] for v in (200.0, 300.0))
    still = [replace(run, touch=replace(run.touch, x_mm=np.full(run.touch.t_s.size, 90.0))) for run in drags]
    nowhere = [replace(run, touch=replace(run.touch, x_mm=np.full(run.touch.t_s.size, np.nan))) for run in drags]
    apart = [laser(run, t_s=run.laser.t_s - 1.7e9) for run in drags]
    wanted = {
        "2 runs at an even speed with edges": drags,
        "the runs hardly travel sideways": still,
        "no run at an even speed shows where the stylus was": nowhere,
        "of 2 of 2 runs at an even speed lie at different times": apart,
    }
    for words, runs in wanted.items():
        missing = what_is_missing(replace(sound, runs=tuple(runs)))
        assert any(words in sentence for sentence in missing), words
        assert not any("circle" in sentence for sentence in missing)
