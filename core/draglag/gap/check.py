"""Posterior predictive check of a report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import chdtrc, ndtri

from draglag.errors import DraglagError
from draglag.gap.constants import (
    FEWEST_RUNS,
    MOST_SCATTER,
    REPEATS_AS_OFTEN,
    SIZE_OF_INTEREST_MM,
    UNLIKELY,
    WIDTH_SD_MM,
)
from draglag.gap.replaying.replay import Replay, replay
from draglag.gap.results import GapReport, Statistic, Tolerated, next_to_unnamed
from draglag.gap.streams.lattice import basis_of, rounded
from draglag.gap.streams.stamps import first_of_repeats, nothing_repeats, repeats, with_unchanged
from draglag.latency.conduct import Estimates
from draglag.latency.estimate import RunEstimate
from draglag.recording import FloatArray, Session, TouchTrace
from draglag.simulation.effects import EFFECTS, effect_class

LATENCY, REPEATS, KIND = "latency by run", "repeated positions", "kind_of_edge"


def checked(session: Session, report: GapReport, estimates: Estimates) -> GapReport:
    """Report with its predictive check. The verdict stays where the simulation fails, or where an effect hides the hand
    and simulated runs miss the latency that the law was fitted to.

    session, estimates: as measured, without excluded runs.
    """
    if report.last is None:
        return report
    named = {step.effect: {name: value for name, (value, _) in step.parameters.items()} for step in report.steps}
    try:
        again = replay(session, report.last, named, measured=estimates)
    except (DraglagError, ValueError, np.linalg.LinAlgError):
        return report
    found = compared_statistics(session, again, report.tolerated)
    off = [one for one in found if not one.agrees]
    hidden = any(effect_class(step.effect).hides_hand for step in report.steps)
    if not off or (hidden and off[0].name == LATENCY):
        return replace(report, check=found)
    steps = report.steps
    if any(one.name == REPEATS for one in off):
        steps = tuple(step for step in steps if effect_class(step.effect).undone_in != "stream")
    if report.verdict != "unexplained":
        steps = tuple(next_to_unnamed(step) for step in steps)
    by = report.unexplained_by or off[0].follows
    return replace(report, check=found, verdict="unexplained", unexplained_by=by, steps=steps)


def compared_statistics(session: Session, again: Replay, tolerated: Sequence[Tolerated] = ()) -> tuple[Statistic, ...]:
    """Statistics of the measured session, streams unrepaired, and of its simulation, which lacks what is tolerated."""
    both = [
        (one.measured, one.simulated) for one in again.runs if one.measured is not None and one.simulated is not None
    ]
    found = [_latency(again), _width(both, _of_width_mm(tolerated)), _scatter(both), _repeats(session, again.session)]
    return tuple(one for one in found if one is not None)


def _latency(again: Replay) -> Statistic | None:
    """RMS of the latency difference times speed."""
    speed, difference, error = again.differences_ms()
    if speed.size < FEWEST_RUNS:
        return None
    moved, expected = (float(np.sqrt(np.mean((1e-3 * x * speed) ** 2))) for x in (difference, error))
    p_value = float(chdtrc(speed.size, np.sum((difference / error) ** 2)))
    agrees = p_value > UNLIKELY or moved < max(SIZE_OF_INTEREST_MM, 2 * expected)
    return Statistic(LATENCY, "speed", moved, expected, "mm RMS", agrees)


def _of_width_mm(tolerated: Sequence[Tolerated]) -> float:
    """RMS over the edges of what is tolerated and follows their kind."""

    def follows(name: str) -> str:
        return effect_class(name).follows if name in EFFECTS else name

    return sum(item.size_mm for item in tolerated if follows(item.follows) == KIND)


def _width(both: list[tuple[RunEstimate, RunEstimate]], tolerated_mm: float) -> Statistic | None:
    rows = [
        (a.stylus_diameter_mm, b.stylus_diameter_mm, a.stylus_diameter_se_mm or 0.0, b.stylus_diameter_se_mm or 0.0)
        for a, b in both
        if a.stylus_diameter_mm is not None and b.stylus_diameter_mm is not None
    ]
    if len(rows) < FEWEST_RUNS:
        return None
    measured, simulated, one, other = np.array(rows, float).T
    weight = 1 / (one**2 + other**2 + WIDTH_SD_MM**2)
    medians = _weighted_median(measured, weight), _weighted_median(simulated, weight)
    of_interest_mm = 2 * (SIZE_OF_INTEREST_MM + tolerated_mm)  # both edges move by half of what a width changes
    surely_mm = float(-ndtri(0.5 * UNLIKELY)) * float(np.sqrt(0.5 * np.pi / weight.sum()))
    agrees = abs(medians[0] - medians[1]) < max(of_interest_mm, surely_mm)
    return Statistic("stylus width", KIND, *medians, "mm", agrees)


def _weighted_median(values: FloatArray, weight: FloatArray) -> float:
    """Median: a run whose latency steps between its edges can have any width. Its standard error is √(π/2) of the
    mean's."""
    order = np.argsort(values)
    share = np.cumsum(weight[order]) - 0.5 * weight[order]
    return float(np.interp(0.5 * weight.sum(), share, values[order]))


def _scatter(both: list[tuple[RunEstimate, RunEstimate]]) -> Statistic | None:
    rows = [(a.j_per_edge_mm2, b.j_per_edge_mm2) for a, b in both if a.j_per_edge_mm2 and b.j_per_edge_mm2]
    if len(rows) < FEWEST_RUNS:
        return None
    measured, simulated = np.sqrt(np.median(np.array(rows, float), axis=0))
    agrees = bool(measured < max(MOST_SCATTER * simulated, SIZE_OF_INTEREST_MM))
    return Statistic("scatter of edges", "scatter", float(measured), float(simulated), "mm RMS", agrees)


def _repeats(session: Session, again: Session) -> Statistic | None:
    """Simulated positions are rounded as measured. Where none repeats, frames left out count instead."""
    own = [run.touch for run in session.runs if run.touch.t_s.size > 1]
    theirs = [run.touch for run in again.runs if run.touch.t_s.size > 1]
    if not own or not theirs:
        return None
    basis = basis_of(own)
    theirs = theirs if basis is None else [rounded(touch, basis) for touch in theirs]
    if nothing_repeats(own) and not nothing_repeats(theirs):
        own, theirs = (with_unchanged([first_of_repeats(touch) for touch in each]) for each in (own, theirs))
    measured, simulated = _repeated(own), _repeated(theirs)
    agrees = abs(measured - simulated) < REPEATS_AS_OFTEN
    return Statistic(REPEATS, "host_tick", measured, simulated, "share of events", agrees)


def _repeated(touches: list[TouchTrace]) -> float:
    return float(np.mean(np.concatenate([repeats(touch) for touch in touches])))
