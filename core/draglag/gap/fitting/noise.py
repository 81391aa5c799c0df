"""Covariance of residuals, in parts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from draglag.gap.constants import MEMORY_S, MISFIT_MM, ROUNDING_MM, USUAL_SPEED_ERROR, USUAL_TREMOR_MM_S
from draglag.gap.traces.edges import Placed
from draglag.gap.traces.run_data import RunData
from draglag.gap.traces.touch_noise import TouchNoise
from draglag.path.motion import SPEED_TIMING_S
from draglag.recording import FloatArray, IntArray

# Grids of the search, coarser than those by which explanations are compared, of the same parts. Physical: see
# posterior/levels.
SLOW_MM = (0.0, 0.05, 0.1, 0.2, 0.4)
SPEED = (0.0, 0.005, 0.01, 0.02, 0.04)
TREMOR_MM_S = (0.0, 1.5, 3.0, 6.0)
UNEVEN = (0.1, 0.3)
# Panels differ by about 0.7 ms from run to run; more is not noise but something missing. Physical.
RUN_S = (0.0, 0.00025, 0.0005, 0.001)
RUN_MM = (0.0, 0.05)  # how the stylus is held differs. Physical (fact sheet on real screens)
UNSTEADY = 0.2  # share of a chirp's or step's own range of latency by which its level may miss the law's. Judgement
ACCEL_MEMORY_S = 0.08  # half the span that an acceleration is taken over. Derived
SPEED_MEMORY_S = 0.15  # how long the hand's own unevenness, faster than the speed window, lasts. Physical
MEMORIES = 12  # after so many of these nothing is left of it (6e-6). Derived


@dataclass(frozen=True)
class Components:
    """Standard deviations beyond touch noise.

    slow_mm: of positions, by noise slower than the windows of local fits. speed: relative error of the law's speed;
    tremor_mm_s: absolute. uneven: relative error of following changes of speed. run_s, run_mm: latency and offset of a
    run. late_s, wander_s: lateness of single reports, and one that wanders. misfit_mm: of each shape that the posterior
    tolerates.
    """

    slow_mm: float = 0.05
    speed: float = USUAL_SPEED_ERROR
    tremor_mm_s: float = USUAL_TREMOR_MM_S
    uneven: float = 0.1
    run_s: float = 0.0003
    run_mm: float = 0.02
    late_s: float = 0.0
    wander_s: float = 0.0
    misfit_mm: float = MISFIT_MM[-1]


LOCAL: tuple[dict[str, tuple[float, ...]], ...] = (  # kinds that trade places are sought together
    {"slow_mm": SLOW_MM},
    {"speed": SPEED, "tremor_mm_s": TREMOR_MM_S},
    {"uneven": UNEVEN},
    {"run_s": RUN_S, "run_mm": RUN_MM},
)
BETWEEN = tuple(product(RUN_S, RUN_MM))


@dataclass(frozen=True)
class Neighbours:
    """Edges of one run within a memory's reach of each other. later (b, m): edge i + j; apart_s (b, m): ∞ if none."""

    later: IntArray
    apart_s: FloatArray

    @classmethod
    def within(cls, memory_s: float, t_s: FloatArray, run: IntArray) -> Neighbours:
        reach_s = MEMORIES * memory_s
        in_order = t_s + run * ((np.ptp(t_s) if t_s.size else 0.0) + 2 * reach_s)
        last = np.searchsorted(in_order, in_order + reach_s, side="right")
        reach = int(np.max(last - np.arange(run.size), initial=1))
        later = np.arange(reach)[:, None] + np.arange(run.size)
        inside = later < run.size
        later = np.minimum(later, run.size - 1)
        inside &= run[later] == run
        return cls(later, np.where(inside, t_s[later] - t_s, np.inf))

    def band(self, values: FloatArray, fades: FloatArray) -> FloatArray:
        """Products of two edges' values, (b, m), that fade with the time between them."""
        return np.asarray(values[self.later] * values * fades)


@dataclass(frozen=True)
class Scatter:
    """Covariance of used edges (m,) per unit component; bands (b, m): row j holds edges i and i + j of one run.

    fixed_mm2: touch noise, time of the speed, blur. slow: correlation of slow noise. late_mm_s, uneven_mm: (m,) by
    latency and uneven following. loose_s: (runs,) misfit allowed to runs of changing speed, and of a state unsure all
    along. t_s: (m,) of edges. blur_mm2: (m,) by what effects leave unknown.
    """

    fixed_mm2: FloatArray
    slow: FloatArray
    speed_mm2: FloatArray
    tremor_s2: FloatArray
    late_mm_s: FloatArray
    uneven_mm: FloatArray
    run: IntArray
    loose_s: FloatArray
    t_s: FloatArray
    blur_mm2: FloatArray | float = 0.0

    @cached_property
    def wander_mm2_s2(self) -> FloatArray:
        """Band by a lateness that wanders."""
        near = Neighbours.within(MEMORY_S, self.t_s, self.run)
        return near.band(self.late_mm_s, np.exp(-near.apart_s / MEMORY_S))

    def rms_mm(self, components: Components) -> dict[str, float]:
        """Part (``touch``, ``blur`` or of ``Components``) → RMS over edges."""
        one, late = np.ones(self.run.size), self.late_mm_s**2
        unit = {
            "slow_mm": one,
            "speed": self.speed_mm2[0],
            "tremor_mm_s": self.tremor_s2[0],
            "uneven": self.uneven_mm**2,
            "run_s": late,
            "run_mm": one,
            "late_s": late,
            "wander_s": late,
        }
        squares = {name: getattr(components, name) ** 2 * values for name, values in unit.items()}
        fixed = {"touch": self.fixed_mm2[0] - self.blur_mm2, "blur": self.blur_mm2}
        return {name: float(np.sqrt(np.mean(mm2))) for name, mm2 in (fixed | squares).items()}


def scatter(
    runs: tuple[RunData, ...],
    placed: Placed,
    use: np.ndarray,
    blur_mm: FloatArray,
    noise: TouchNoise | None = None,
) -> Scatter:
    """Scatter of the used edges.

    blur_mm: (all placed) error by what effects leave unknown. noise: by touch events, of another placing nearby.
    """
    run, t_s = placed.run[use], placed.t_s[use]
    late_mm_s = placed.v_mm_s[use, 1]
    follows = late_mm_s * placed.stretch[use] * placed.slope_s2_mm[use]
    speed = placed.speed_mm_s[use]
    uneven_mm, loose_s = np.zeros(run.size), open_levels_s(runs, placed, use)
    for k in np.unique(run):
        own = run == k
        uneven_mm[own] = follows[own] * (speed[own] - speed[own].mean())
    if placed.unsure_s is not None:
        loose_s = np.hypot(loose_s, placed.unsure_s)
    near = Neighbours.within(SPEED_MEMORY_S, t_s, run)
    fixed = (noise or placed.touch_noise).band_mm2(use, near.later.shape[0])
    fixed[0] += timing_mm(placed)[use] ** 2 + ROUNDING_MM**2
    if blur_mm[use].any():
        fixed += near.band(blur_mm[use], np.exp(-near.apart_s / ACCEL_MEMORY_S))
    fades = np.exp(-near.apart_s / SPEED_MEMORY_S)
    share, tremor = near.band(follows * speed, fades), near.band(follows, fades)
    # A window averages faster noise, and half of it is how long the rest lasts.
    half_s = np.array([data.half_s for data in runs])
    slow = near.band(np.ones(run.size), np.exp(-near.apart_s / half_s[run]))
    return Scatter(fixed, slow, share, tremor, late_mm_s, uneven_mm, run, loose_s, t_s, blur_mm[use] ** 2)


def open_levels_s(runs: tuple[RunData, ...], placed: Placed, use: np.ndarray) -> FloatArray:
    """By how much the level of each run may miss the law's, (runs,) s: 0 of a run of one speed."""
    out = np.zeros(len(runs))
    for k in np.unique(placed.run[use]):
        if not runs[k].steady:
            out[k] = UNSTEADY * float(np.std(placed.latency_s[use & (placed.run == k)]))
    return out


def timing_mm(placed: Placed) -> FloatArray:
    """Standard deviation by the time of the speed, (m,)."""
    follows = placed.v_mm_s[:, 1] * placed.stretch * placed.slope_s2_mm
    return np.asarray(follows * placed.accel_mm_s2 * SPEED_TIMING_S)
