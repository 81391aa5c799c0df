"""Covariance of residuals, in parts."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from draglag.gap.traces.edges import Placed
from draglag.gap.traces.run_data import RunData
from draglag.path.motion import SPEED_TIMING_S
from draglag.recording import FloatArray, IntArray

EDGE_MM = (0.0, 0.05, 0.1, 0.2, 0.4)
SPEED = (0.0, 0.005, 0.01, 0.02, 0.04)
TREMOR_MM_S = (0.0, 1.5, 3.0, 6.0)
UNEVEN = (0.1, 0.3)
# Panels differ by about 0.7 ms from run to run; more is not noise but something missing.
RUN_S = (0.0, 0.00025, 0.0005, 0.001)
RUN_MM = (0.0, 0.05)
UNSTEADY = 0.2  # share of a chirp's or step's own range of latency by which its level may miss the law's
ACCEL_MEMORY_S = 0.08  # half the span that an acceleration is taken over
SPEED_MEMORY_S = 0.15  # how long the hand's own unevenness, faster than the speed window, lasts
MEMORIES = 12  # after so many of these nothing is left of it (6e-6)

Sizes = dict[str, float]


@dataclass(frozen=True)
class Components:
    """Standard deviations beyond touch noise.

    speed: relative error of the law's speed; tremor_mm_s: absolute. uneven: relative error of following changes of
    speed.
    """

    edge_mm: float
    speed: float
    tremor_mm_s: float
    uneven: float
    run_s: float
    run_mm: float


LOCAL: tuple[tuple[Sizes, ...], ...] = (  # kinds that trade places are sought together
    tuple({"edge_mm": e} for e in EDGE_MM),
    tuple({"speed": s, "tremor_mm_s": t} for s, t in product(SPEED, TREMOR_MM_S)),
    tuple({"uneven": u} for u in UNEVEN),
    tuple({"run_s": s, "run_mm": b} for s, b in product(RUN_S, RUN_MM)),
)
BETWEEN = tuple(product(RUN_S, RUN_MM))


@dataclass(frozen=True)
class Scatter:
    """Covariance of used edges (m,) per unit component; bands (b, m): row j holds edges i and i + j of one run.

    fixed_mm2: touch noise, time of the speed, acceleration. late_mm_s, uneven_mm: (m,) by the run's latency and uneven
    following. loose_s: (runs,) misfit allowed to runs of changing speed.
    """

    fixed_mm2: FloatArray
    speed_mm2: FloatArray
    tremor_s2: FloatArray
    late_mm_s: FloatArray
    uneven_mm: FloatArray
    run: IntArray
    loose_s: FloatArray


def scatter(runs: tuple[RunData, ...], placed: Placed, use: np.ndarray, blur_mm: FloatArray) -> Scatter:
    """Scatter of the used edges. blur_mm: (all placed) error by effects of the acceleration."""
    run, t_s = placed.run[use], placed.t_s[use]
    m = run.size
    late_mm_s = placed.v_mm_s[use, 1]
    follows = late_mm_s * placed.stretch[use] * placed.slope_s2_mm[use]
    speed = placed.speed_mm_s[use]
    uneven_mm, loose_s = np.zeros(m), np.zeros(len(runs))
    reach = 1
    for k, data in enumerate(runs):
        own = run == k
        if not own.any():
            continue
        uneven_mm[own] = follows[own] * (speed[own] - speed[own].mean())
        if not data.steady:
            loose_s[k] = UNSTEADY * float(np.std(placed.latency_s[use][own]))
        within = np.searchsorted(t_s[own], t_s[own] + MEMORIES * SPEED_MEMORY_S, side="right")
        reach = max(reach, int(np.max(within - np.arange(within.size))))
    later = np.arange(reach)[:, None] + np.arange(m)
    inside = later < m
    later = np.minimum(later, m - 1)
    inside &= run[later] == run
    apart_s = np.where(inside, t_s[later] - t_s, np.inf)

    def band(values: FloatArray, fades: FloatArray) -> FloatArray:
        return np.asarray(values[later] * values * fades)

    fixed = placed.touch_noise.band_mm2(use, reach)
    fixed[0] += timing_mm(placed)[use] ** 2 + 1e-6
    if blur_mm[use].any():
        fixed += band(blur_mm[use], np.exp(-apart_s / ACCEL_MEMORY_S))
    fades = np.exp(-apart_s / SPEED_MEMORY_S)
    share, tremor = band(follows * speed, fades), band(follows, fades)
    return Scatter(fixed, share, tremor, late_mm_s, uneven_mm, run, loose_s)


def timing_mm(placed: Placed) -> FloatArray:
    """Standard deviation by the time of the speed, (m,)."""
    follows = placed.v_mm_s[:, 1] * placed.stretch * placed.slope_s2_mm
    return np.asarray(follows * placed.accel_mm_s2 * SPEED_TIMING_S)
