"""Systematic errors, common to all edges (GUM, type B; docs/precision.md)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from draglag.latency.estimate import RunEstimate

COVERAGE_FACTOR = 1.96  # expanded (95 %) over standard uncertainty of a normal distribution


@dataclass(frozen=True)
class Contribution:
    """One cause of late edges: a delay, or a displacement ``way_mm`` along the motion, which costs way / speed."""

    name: str
    delay_s: float = 0.0
    delay_u_s: float = 0.0
    way_mm: float = 0.0
    way_u_mm: float = 0.0


# Response: the paper rates the sensor at 55 us (Section II.B), which single sensors and amounts of light change by up
# to a quarter: rectangular. Interface: about 1 us (the paper), of which nothing is known: rectangular from 0 to 2 us.
# Hysteresis: a comparator whose levels lie h = 0.5 to 2 % of the light apart from a threshold of 20 to 50 % of it, in a
# Gaussian beam of sigma = 0.15 to 0.4 mm, switches delta = h sigma / phi(z) late; each even in its range, this is
# 9.6 um with a standard deviation of 4.4 um.
BUDGET = (
    Contribution("sensor response", delay_s=55e-6, delay_u_s=13.75e-6 / 3**0.5),
    Contribution("interface", delay_s=1e-6, delay_u_s=1e-6 / 3**0.5),
    Contribution("comparator hysteresis", way_mm=9.6e-3, way_u_mm=4.4e-3),
)


@dataclass(frozen=True)
class Systematic:
    """Correction to add to a latency."""

    correction_s: float
    u_s: float


def systematic(lateness_s_per_mm: float, budget: Sequence[Contribution] = BUDGET) -> Systematic:
    """Correction and uncertainty, summed over the budget."""
    correction_s = sum(c.delay_s + c.way_mm * lateness_s_per_mm for c in budget)
    variance = sum(c.delay_u_s**2 + (c.way_u_mm * lateness_s_per_mm) ** 2 for c in budget)
    return Systematic(float(correction_s), float(np.sqrt(variance)))


def lateness_s_per_mm(estimate: RunEstimate) -> float:
    """Latency per mm along the motion: ⟨|v|⟩/⟨v²⟩, v across the beam (least squares weighs by v²)."""
    if estimate.alignment is None:
        return 1.0 / estimate.speed_mm_s if estimate.speed_mm_s else 0.0
    v = estimate.alignment.v_mm_s
    across = np.abs(v[:, 1] - estimate.alignment.slope * v[:, 0])
    return float(across.mean() / max(float(np.mean(across**2)), 1e-9))


def with_systematics(estimate: RunEstimate, correct: bool = True) -> RunEstimate:
    """The estimate corrected for the budget, its interval and standard errors widened.

    ``correct=False`` keeps the value; the upper end then includes the correction.
    """
    if estimate.latency_s is None or estimate.latency_ci95_s is None:
        return estimate
    known = systematic(lateness_s_per_mm(estimate))
    half_s = COVERAGE_FACTOR * known.u_s
    shift_s = known.correction_s if correct else 0.0
    low_s, high_s = (end - estimate.latency_s for end in estimate.latency_ci95_s)
    at_s = estimate.latency_s + shift_s
    late_s = known.correction_s - shift_s
    return replace(
        widened(estimate, known.u_s),
        latency_s=at_s,
        latency_ci95_s=(at_s - float(np.hypot(low_s, half_s)), at_s + late_s + float(np.hypot(high_s, half_s))),
        correction_s=shift_s,
        systematic_s=float(np.hypot(estimate.clock_uncertainty_s or 0.0, half_s)),
    )


def widened(estimate: RunEstimate, u_s: float) -> RunEstimate:
    """The estimate with ``u_s`` added to its standard errors in quadrature."""
    mean, at_speed = (
        None if own is None else float(np.hypot(own, u_s)) for own in (estimate.latency_se_s, estimate.se_at_speed_s)
    )
    return replace(estimate, latency_se_s=mean, se_at_speed_s=at_speed)


def common_delay_u_s(budget: Sequence[Contribution] = BUDGET) -> float:
    """Standard uncertainty of the delay common to all runs."""
    return float(np.sqrt(sum(c.delay_u_s**2 for c in budget)))
