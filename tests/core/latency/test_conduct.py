"""Runs that did not go as they should stay out of the curve, with the reason as their verdict."""

from dataclasses import replace

import numpy as np
import pytest
from tests.realistic.session import make_session

from bench.strokes import even_strokes
from draglag.analysis import AnalysisOptions, analyze
from draglag.curve import CurvePoints, fit_best
from draglag.errors import EstimateError
from draglag.gap import close_gap
from draglag.gap.results import unjudged
from draglag.recording import Run, Session, empty_laser
from draglag.simulation import rig_for_screen


@pytest.fixture(scope="module")
def session() -> Session:
    return make_session(5, "double", 15.0)[0]


def with_run(session: Session, changed: Run) -> Session:
    return replace(session, runs=tuple(changed if run.id == changed.id else run for run in session.runs))


def of(session: Session, speed_mm_s: float) -> Run:
    return next(run for run in session.runs if run.nominal_speed_mm_s == speed_mm_s)


@pytest.mark.parametrize("outcome", ["aborted", "device_lost", "failed"])
def test_a_run_that_did_not_end_well_is_not_in_the_curve(session: Session, outcome: str) -> None:
    run = of(session, 290.0)
    broken = with_run(session, replace(run, outcome=outcome))
    without = analyze(broken)
    assert without.curve is not None
    assert without.curve.n_points == len(session.runs) - 1
    assert without.excluded == {run.id: outcome.replace("_", " ")}
    said = next(row for row in without.to_dict()["runs"] if row["id"] == run.id)  # type: ignore[attr-defined, index]
    assert outcome in said["flags"]
    assert said["in_curve"] is False
    included = analyze(broken, AnalysisOptions(include=frozenset({run.id})))
    assert included.curve is not None
    assert included.curve.n_points == len(session.runs)
    assert included.excluded == {}


def test_a_run_that_gave_nothing_is_not_named_once_its_repeat_did(session: Session) -> None:
    """The laser saw nothing of the run, and nothing of its first repeat."""
    run = of(session, 290.0)
    blind = replace(run, laser=empty_laser())
    others = [one for one in session.runs if one.id != run.id]
    again = [replace(blind, id=f"{run.id}-2", outcome="aborted"), replace(run, id=f"{run.id}-3")]
    alone = analyze(replace(session, runs=(blind, *others)))
    assert alone.repeated == {}
    assert any(run.id in text for text in alone.problems)
    found = analyze(replace(session, runs=(blind, *others, *again)))
    assert found.repeated == {run.id: f"{run.id}-3", f"{run.id}-2": f"{run.id}-3"}
    assert not [text for text in (*found.problems, *found.warnings) if run.id in text]
    assert found.excluded == {f"{run.id}-2": "aborted"}


def test_a_run_included_by_hand_is_not_repeated_and_a_repeat_without_a_latency_repeats_nothing(
    session: Session,
) -> None:
    run = of(session, 290.0)
    others = [one for one in session.runs if one.id != run.id]
    aborted, again = replace(run, outcome="aborted"), replace(run, id=f"{run.id}-2")
    both = replace(session, runs=(aborted, *others, again))
    assert analyze(both).repeated == {run.id: again.id}
    assert analyze(both, AnalysisOptions(include=frozenset({run.id}))).repeated == {}
    no_use = replace(again, laser=empty_laser())
    assert analyze(replace(both, runs=(aborted, *others, no_use))).repeated == {}


def test_the_gap_leaves_out_the_same_runs_as_the_curve(session: Session) -> None:
    """A run at another latency would be a gap: as an aborted one it is none, and it is listed."""
    run = of(session, 290.0)
    late = replace(run.touch, t_s=run.touch.t_s + 0.02)
    broken = with_run(session, replace(run, touch=late, outcome="aborted"))
    report = close_gap(broken)
    assert report.excluded == {run.id: "aborted"} == analyze(broken).excluded
    assert report.last is not None
    assert run.id not in {data.run.id for data in report.last.runs}
    assert f"{run.id} (aborted)" in unjudged(broken, report)
    included = close_gap(broken, max_effects=0, include=(run.id,))
    assert included.excluded == {}
    assert included.verdict == "unexplained"


def test_a_complete_run_with_most_of_its_laser_missing_is_not_in_the_curve(session: Session) -> None:
    run = of(session, 290.0)
    early = run.laser.t_s < run.start_s + 0.4 * run.duration_s
    laser = replace(run.laser, t_s=run.laser.t_s[early], light=run.laser.light[early])
    found = analyze(with_run(session, replace(run, laser=laser)))
    assert found.excluded == {run.id: "laser missing"}


def test_a_run_of_another_speed_is_not_in_the_curve(session: Session) -> None:
    run = of(session, 290.0)
    assert analyze(with_run(session, replace(run, nominal_speed_mm_s=800.0))).excluded == {run.id: "far from nominal"}
    slightly = analyze(with_run(session, replace(run, nominal_speed_mm_s=420.0)))
    assert slightly.excluded == {}
    assert "off_speed" in next(e.flags for e in slightly.runs if e.id == run.id)


def test_a_run_whose_speed_changes_midway_is_not_in_the_curve(session: Session) -> None:
    """The second half of the run takes half of the time: twice the speed."""
    run = of(session, 200.0)
    middle_s = run.start_s + 0.5 * run.duration_s

    def faster(t_s: np.ndarray) -> np.ndarray:
        return np.where(t_s > middle_s, middle_s + 0.5 * (t_s - middle_s), t_s)

    changed = replace(
        run,
        touch=replace(run.touch, t_s=faster(run.touch.t_s)),
        laser=replace(run.laser, t_s=faster(run.laser.t_s)),
    )
    found = analyze(with_run(session, changed))
    assert "speed changed" in found.excluded[run.id]


def test_sound_runs_are_all_in_the_curve(session: Session) -> None:
    found = analyze(session)
    assert found.excluded == {}
    assert found.curve is not None
    assert found.curve.n_points == len(session.runs)


def test_three_speeds_give_no_curve_but_say_how_many_are_needed(session: Session) -> None:
    three = replace(session, runs=tuple(of(session, v) for v in (90.0, 200.0, 420.0)))
    found = analyze(three)
    assert found.curve is None
    assert any("3 different speeds are too few for a curve: at least 5 are needed" in text for text in found.problems)


def test_too_few_speeds_of_uneven_drags_ask_for_even_ones(session: Session) -> None:
    uneven = [
        even_strokes(rig_for_screen("screen-1"), v, 120.0, speeds=(1.0, 0.5), off_middle=0.3, run_id=f"free-{v:.0f}")[0]
        for v in (250.0, 350.0)
    ]
    few = replace(session, runs=(*(of(session, v) for v in (90.0, 200.0, 420.0)), *uneven))
    said = (
        "2 free drags are left out (free-250, free-350), their speed or their touch trace is uneven at the beam: "
        "cross it at an even speed, and turn far from it"
    )
    found = analyze(few)
    assert f"3 different speeds are too few for a curve: at least 5 are needed. {said}." in found.problems
    assert not any("more speeds" in text for text in found.problems)
    assert said in close_gap(few).missing


def test_repeats_of_a_speed_count_once() -> None:
    speed = np.repeat([50.0, 100.0, 400.0], 5) * np.tile([0.98, 0.99, 1.0, 1.01, 1.02], 3)
    with pytest.raises(EstimateError, match="3 different speeds"):
        fit_best(CurvePoints(speed, np.full(15, 0.05), np.full(15, 1e-4)))


def swinging(run: Run, share: float) -> Run:
    """The run on a clock by which its speed swings by a share of its mean, every 2 s."""

    def warped(t_s: np.ndarray) -> np.ndarray:
        since_s = t_s - run.touch.t_s[0]
        return np.asarray(t_s + share / np.pi * np.sin(np.pi * since_s))

    touch, laser = replace(run.touch, t_s=warped(run.touch.t_s)), replace(run.laser, t_s=warped(run.laser.t_s))
    return replace(run, protocol="free", touch=touch, laser=replace(laser, device_t_s=np.empty(0)))


@pytest.mark.parametrize(("share", "in_curve"), [(0.1, True), (0.6, False)])
def test_a_free_drag_is_a_point_of_the_curve_only_at_one_speed(session: Session, share: float, in_curve: bool) -> None:
    """A mean latency at a mean speed is no point of a curve that bends: such a drag is compared with it, as a chirp."""
    run = of(session, 290.0)
    found = analyze(with_run(session, swinging(run, share)))
    assert found.curve is not None
    assert found.curve.n_points == len(session.runs) - (not in_curve)
    assert (run.id in {one.id for one in found.runs}) == in_curve
    assert (run.id in {one.run for one in found.validation}) == (not in_curve)
    assert any("free drag" in words and run.id in words for words in found.warnings) == (not in_curve)


def test_many_free_drags_are_one_warning(session: Session) -> None:
    runs = tuple(
        swinging(run, 0.6) if run.nominal_speed_mm_s and run.nominal_speed_mm_s > 70 else run for run in session.runs
    )
    free = [run.id for run in runs if run.protocol == "free"]
    found = analyze(replace(session, runs=runs), AnalysisOptions(form="constant"))
    (words,) = [words for words in found.warnings if "free drags" in words]
    assert words.startswith(f"{len(free)} free drags")
    assert free[0] in words


def test_only_a_free_drag_that_was_compared_is_said_to_be_compared_with_the_curve(session: Session) -> None:
    changing = [replace(swinging(of(session, v), 0.6), id=f"free-{v:.0f}") for v in (200.0, 290.0)]
    for gone, compared in ((None, "free-200, free-290"), ("aborted", "free-200")):
        changing[1] = replace(changing[1], outcome=gone or "complete")
        whole = replace(session, runs=(*session.runs, *changing))
        (words,) = [words for words in analyze(whole).warnings if "compared with the curve" in words]
        assert words.endswith(f"({compared})")
    few = analyze(replace(session, runs=(of(session, 90.0), *changing)))
    assert few.curve is None
    assert not any("compared with the curve" in words for words in few.warnings)
    assert any("free-200: not validated, there is no curve" in words for words in few.problems)
