"""What a step states in favour of its effect."""

from __future__ import annotations

import re
from functools import lru_cache

import pytest

from core import sound_sessions
from draglag.gap import GapReport, close_gap
from draglag.gap import steps as steps_module


@lru_cache
def of_a_drift() -> GapReport:
    return close_gap(sound_sessions.brief("clock_drift=60"))


def test_a_gap_that_falls_needs_no_other_evidence() -> None:
    (step,) = of_a_drift().steps
    assert step.gap_after_mm < step.gap_before_mm
    assert re.match(r"deviance falls by \d+", step.evidence)
    assert "predicted better" not in step.evidence


def test_where_the_rms_does_not_fall_the_prediction_is_stated(monkeypatch: pytest.MonkeyPatch) -> None:
    """Or a reader would find an effect that explains a gap which has grown."""
    monkeypatch.setattr(steps_module, "shrinks", lambda before, after: False)
    (step,) = close_gap(sound_sessions.brief("clock_drift=60")).steps
    said = re.search(r"held-out runs, whose RMS does not fall, are predicted better by (\d+) nats", step.evidence)
    assert said is not None
    assert int(said[1]) > 3
