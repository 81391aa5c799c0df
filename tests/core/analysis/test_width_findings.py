"""A stylus width that disagrees with the ruler is a finding, one that noise and sensor explain is none."""

from dataclasses import replace

import numpy as np
from tests.realistic.session import DIAMETER_MM, make_session

from draglag.analysis import analyze
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


def test_one_run_of_another_width_is_named() -> None:
    """One run's touch positions across the beam are stretched by a third: its lines lie 2.3 mm further apart."""
    session, _ = make_session(6, "constant", 10.0)
    run = session.runs[2]
    middle = float(np.median(run.touch.y_mm))
    stretched = replace(run, touch=replace(run.touch, y_mm=middle + 1.33 * (run.touch.y_mm - middle)))
    found = analyze(replace(session, runs=tuple(stretched if r.id == run.id else r for r in session.runs)))
    assert any(f"stylus width of {run.id} disagrees" in text for text in found.warnings)
