"""Whether a run must be recorded again."""

from __future__ import annotations

from collections.abc import Sequence

from draglag.latency import estimate_on_clock
from draglag.latency.conduct import is_usable, with_conduct
from draglag.latency.steady import has_constant_speed
from draglag.recording import ClockBounds, Run

UNUSABLE = "unusable"
"""A whole run without a latency for the curve."""


def went_wrong(run: Run, outcome: str, clocks: Sequence[ClockBounds], stylus_mm: float) -> str:
    """Why a run must be recorded again; empty if usable.

    ``clocks``: comparisons outside runs.
    """
    if outcome != "complete":
        return outcome
    if not has_constant_speed(run):  # recorded for the validation, which needs no latency of its own
        return ""
    estimate = with_conduct(estimate_on_clock(run, clocks, stylus_mm), run)
    return "" if is_usable(estimate) else UNUSABLE
