"""An effect that a person adds to a gap report, and what the Gap page shows with it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from core import sound_sessions
from draglag.errors import DataError
from draglag.gap import GapReport, close_gap
from draglag.gap.by_hand import add_by_hand
from draglag.model.file import LatencyModel
from draglag.recording import Session
from draglag_app.in_subprocess import close_gap_of


@pytest.fixture(scope="module")
def session() -> Session:
    return sound_sessions.brief("scan_skew=0.02")


@pytest.fixture(scope="module")
def unnamed(session: Session) -> GapReport:
    return close_gap(session, candidates=["laser_bounce"])


@pytest.fixture(scope="module")
def with_skew(session: Session, unnamed: GapReport) -> GapReport:
    return add_by_hand(session, unnamed, "scan_skew")


def test_the_right_effect_shrinks_the_gap_and_says_by_how_much(with_skew: GapReport) -> None:
    after = with_skew
    step = after.steps[-1]
    value, (low, high) = step.parameters["across_s"]
    assert low - 0.001 < 0.02 < high + 0.001, value
    assert step.evidence.endswith("shrinks")
    assert step.gap_after_mm < 0.6 * step.gap_before_mm
    assert after.verdict == "explained"
    assert after.gap_last_mm == step.gap_after_mm


def test_a_wrong_effect_is_added_but_not_said_to_help(session: Session, unnamed: GapReport) -> None:
    after = add_by_hand(session, unnamed, "beam_width")
    assert not after.steps[-1].evidence.endswith("shrinks")
    assert after.verdict == "unexplained"


@pytest.mark.parametrize("cause", ["scatter", "acceleration", "frame"])
def test_what_was_unexplained_is_not_explained_by_an_effect_that_closes_nothing(
    session: Session, with_skew: GapReport, cause: str
) -> None:
    """Scatter, a law of another speed and stalls are reported with the finding: a good one does not exclude them."""
    after = add_by_hand(session, replace(with_skew, verdict="unexplained", unexplained_by=cause), "beam_wedge")
    assert not after.steps[-1].evidence.endswith("shrinks")
    assert (after.verdict, after.unexplained_by) == ("unexplained", cause)


def test_what_cannot_be_added_by_hand_is_refused(session: Session, unnamed: GapReport) -> None:
    with pytest.raises(DataError, match="cannot be fitted"):
        add_by_hand(session, unnamed, "sample_hold")
    twice = add_by_hand(session, unnamed, "clock_drift")
    with pytest.raises(DataError, match="already"):
        add_by_hand(session, twice, "thermal_drift")


def test_the_page_gets_report_overlay_and_model(session: Session, unnamed: GapReport) -> None:
    reported: list[float] = []
    got = close_gap_of(
        session,
        frozenset(),
        ("scan_skew",),
        unnamed,
        None,
        frozenset(),
        lambda fraction, text: reported.append(fraction),
    )
    assert reported == sorted(reported)
    assert got["report"].steps[-1].effect == "scan_skew"  # type: ignore[attr-defined]
    assert LatencyModel.model_validate(got["model"]).effects[0].id == "scan_skew"
    before, after = got["overlay"]["models"]  # type: ignore[index]
    assert after["edge_rms_ms_ci95"][1] < before["edge_rms_ms_ci95"][0]
