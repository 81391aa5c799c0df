"""The workflow's verbs put together by hand: the same result as the workflow's own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from core import sound_sessions
from draglag.errors import DataError
from draglag.gap import Gap, GapReport, Model, find, name, shrinkage
from draglag.gap.provisional import provisional_term
from draglag.gap.results import Step
from draglag.recording import Session


@pytest.fixture(scope="module")
def session() -> Session:
    return sound_sessions.with_plateau()


@pytest.fixture(scope="module")
def whole() -> GapReport:
    return sound_sessions.report_of_plateau()


@pytest.fixture(scope="module")
def by_hand(session: Session) -> dict[str, Any]:
    """What the lines under “One by one, in Python” of docs/gap.md leave, run as printed on this session."""
    page = (Path(__file__).parents[3] / "docs" / "gap.md").read_text("utf-8")
    code = page.split("```python")[1].split("```")[0]
    given = 'session = dl.simulate("screen-1", effects={"clock_drift": 60}, seed=3)'
    assert given in code
    scope: dict[str, Any] = {"session": session}
    exec(code.replace(given, ""), scope)
    return scope


@pytest.fixture(scope="module")
def before(by_hand: dict[str, Any]) -> Gap:
    found: Gap = by_hand["before"]
    return found


def test_the_verbs_composed_reproduce_the_workflow(by_hand: dict[str, Any], before: Gap, whole: GapReport) -> None:
    assert before.gap_mm == pytest.approx(whole.gap_first_mm, rel=0.02)
    names: tuple[Step, ...] = by_hand["names"]
    assert names[0].effect == whole.steps[0].effect == "low_speed_plateau"
    after: Gap = by_hand["after"]
    assert after.gap_mm == pytest.approx(whole.gap_last_mm, rel=0.05)
    assert after.noise_floor_mm == pytest.approx(whole.noise_floor_mm, rel=0.05)
    value, (low, high) = after.model.parameters["low_speed_plateau"]["speed_mm_s"]
    assert value == pytest.approx(whole.steps[0].parameters["speed_mm_s"][0], abs=high - low)
    shrunk = shrinkage(before, after)
    assert shrunk.verdict == "shrinks"
    assert shrunk.change_ci95_mm[1] < 0
    assert shrunk.to_dict()["gap_after_mm"] == after.gap_mm
    assert name(after) == ()


def test_a_model_of_another_session_is_fitted_again(before: Gap) -> None:
    """Neither its edges nor its numbers are those of the session it is compared with."""
    drifting = sound_sessions.brief("clock_drift=100")
    there = find(drifting, before.model)
    alone = find(drifting, Model())
    assert there.gap_mm == pytest.approx(alone.gap_mm)
    after = find(drifting, before.model.with_effect("clock_drift"))
    drift_ppm, (low, high) = after.model.parameters["clock_drift"]["drift_ppm"]
    assert drift_ppm == pytest.approx(100, abs=1.5 * (high - low) / 2)
    assert shrinkage(there, after).verdict == "shrinks"


@pytest.mark.parametrize("value", ["a", None, True])
def test_a_value_that_is_no_number_is_refused(value: object) -> None:
    with pytest.raises(DataError, match="cannot be held at drift_ppm"):
        Model().with_effect("clock_drift", {"drift_ppm": value})  # type: ignore[dict-item]


def test_the_manual_s_example_runs_as_printed(by_hand: dict[str, Any]) -> None:
    assert by_hand["change"].verdict == "shrinks"


def test_an_effect_of_known_size_is_taken_out_and_one_of_unknown_size_fitted() -> None:
    measured = sound_sessions.brief("laser_hysteresis=0.0025")
    before = find(measured, Model())
    held = find(measured, Model().with_effect("laser_hysteresis", {"delay_s": 0.0025}))
    fitted = find(measured, before.model.with_effect("laser_hysteresis"))
    size, (low, high) = fitted.model.parameters["laser_hysteresis"]["delay_s"]
    assert low - 1e-4 < 0.0025 < high + 1e-4, size
    assert held.gap_mm == pytest.approx(fitted.gap_mm, rel=0.1)
    assert held.gap_mm < 0.5 * before.gap_mm


def test_what_cannot_be_added_is_refused_in_one_sentence() -> None:
    model = Model().with_effect("clock_drift")
    for call, words in (
        (lambda: model.with_effect("gremlins"), "unknown effect"),
        (lambda: model.with_effect("clock_drift"), "already"),
        (lambda: model.with_effect("scan_skew", {"width": 1.0}), "no parameter"),
        (lambda: model.with_effect("low_speed_plateau", {"speed_mm_s": 100.0}), "cannot be held"),
        (lambda: model.without_effect("scan_skew"), "not in the model"),
    ):
        with pytest.raises(DataError, match=words):
            call()
    assert model.without_effect("clock_drift") == Model()


def test_a_gap_without_a_name_is_closed_provisionally() -> None:
    report = sound_sessions.report_of_unnamed_skew()
    assert report.verdict == "unexplained"
    term = provisional_term(report)
    assert term is not None
    assert term.name == f"unnamed:{report.unexplained_by}"
    assert term.gap_after_mm < 0.7 * term.gap_before_mm
    assert (term.low < term.value).all()
    assert term.to_dict()["term"]
    # 30 ms over the panel, earlier on the left.
    assert term.covariate == "x"
    slope = (term.value[-1] - term.value[0]) / (term.x[-1] - term.x[0]) * 509.2
    assert slope == pytest.approx(30, abs=6)
    assert term.words().startswith(f"Provisional term {term.name} ")
    assert " mm. It has no name" in term.words()  # where on the panel it is largest


def test_without_a_gap_there_is_no_provisional_term(whole: GapReport) -> None:
    assert provisional_term(whole) is None


def test_nothing_is_looked_for_that_the_library_does_not_have(before: Gap) -> None:
    with pytest.raises(DataError, match="unknown effect 'split_panel'"):
        name(before, ["low_speed_plateau", "split_panel"])
    # A single id is that effect, not its letters.
    assert [step.effect for step in name(before, "low_speed_plateau")] == ["low_speed_plateau"]


@pytest.mark.parametrize("values", [{}, {"drift_ppm": float("nan")}, {"drift_ppm": 1e9}])
def test_an_effect_is_held_at_sizes_of_its_bounds_only(values: dict[str, float]) -> None:
    with pytest.raises(DataError, match="clock_drift"):
        Model().with_effect("clock_drift", values)


def test_gaps_of_two_sessions_are_not_compared(session: Session, before: Gap) -> None:
    other = find(replace(session, name="another"), Model())
    with pytest.raises(DataError, match="two sessions"):
        shrinkage(before, other)
