"""A stylus width that disagrees with the ruler is a finding, one that noise and sensor explain is none."""

from dataclasses import replace

import numpy as np
import pytest
from tests.realistic.session import DIAMETER_MM, make_session

from draglag.analysis import AnalysisOptions, analyze
from draglag.errors import EstimateError
from draglag.recording import Stylus


def findings(known_mm: float) -> list[str]:
    session, _ = make_session(5, "double", 10.0)
    found = analyze(replace(session, stylus=Stylus(known_mm)))
    return [text for text in found.warnings if "by ruler" in text]


def test_a_wrong_diameter_is_found_and_says_what_to_do() -> None:
    (said,) = findings(DIAMETER_MM + 1.0)
    assert "by ruler 8 mm" in said
    assert "Measure the stylus" in said


def test_the_right_diameter_is_no_finding() -> None:
    assert findings(DIAMETER_MM) == []


def test_a_single_run_is_compared_with_the_ruler_too() -> None:
    """Its positions across the beam are half of what they should be, as on a wrongly calibrated touchscreen."""
    session, _ = make_session(5, "double", 10.0)
    run = session.runs[2]
    small = replace(run, touch=replace(run.touch, y_mm=0.5 * run.touch.y_mm))
    said = {one.id: analyze(replace(session, runs=(one,))).warnings for one in (run, replace(small, id="small"))}
    assert [text for text in said[run.id] if "by ruler" in text] == []
    assert [text for text in said["small"] if "by ruler" in text] != []


def test_one_run_of_another_width_is_named() -> None:
    """One run's touch positions across the beam are stretched by a third: its lines lie 2.3 mm further apart."""
    session, _ = make_session(6, "constant", 10.0)
    run = session.runs[2]
    middle = float(np.median(run.touch.y_mm))
    stretched = replace(run, touch=replace(run.touch, y_mm=middle + 1.33 * (run.touch.y_mm - middle)))
    found = analyze(replace(session, runs=tuple(stretched if r.id == run.id else r for r in session.runs)))
    assert any(f"stylus width of {run.id} disagrees" in text for text in found.warnings)


def test_a_wrong_diameter_is_corrected_in_the_analysis_and_changes_no_latency() -> None:
    session, _ = make_session(5, "double", 10.0)
    wrong = replace(session, stylus=Stylus(DIAMETER_MM + 1.0))
    found = analyze(wrong, AnalysisOptions(stylus_mm=DIAMETER_MM))
    assert [text for text in found.warnings if "by ruler" in text] == []
    assert found.width is not None
    assert found.width.known_mm == DIAMETER_MM
    assert found.options.kept()["stylus_mm"] == DIAMETER_MM
    assert wrong.stylus.diameter_mm == DIAMETER_MM + 1.0
    assert [run.latency_s for run in found.runs] == [run.latency_s for run in analyze(wrong).runs]


def test_the_diameter_decides_which_changes_of_the_light_are_bounces() -> None:
    session, _ = make_session(5, "double", 10.0)
    rejected = [
        sum(run.n_rejected for run in analyze(session, AnalysisOptions(stylus_mm=diameter_mm)).runs)
        for diameter_mm in (DIAMETER_MM, 10 * DIAMETER_MM)
    ]
    assert rejected[0] < rejected[1]


@pytest.mark.parametrize("diameter_mm", [0.0, -7.0, float("nan"), float("inf")])
def test_what_no_stylus_measures_is_refused(diameter_mm: float) -> None:
    session, _ = make_session(5, "double", 10.0)
    with pytest.raises(EstimateError, match="a stylus cannot be"):
        analyze(session, AnalysisOptions(stylus_mm=diameter_mm))
