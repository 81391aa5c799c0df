"""Latency law, beam and their columns."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.special import expit

from draglag.curve import CurvePoints, fit_form
from draglag.errors import EstimateError
from draglag.gap.traces.edges import TRACKED_S, Placed
from draglag.gap.traces.run_data import RunData
from draglag.instruments.beam import sides
from draglag.messages import message
from draglag.recording import FloatArray

# Weak priors, standard deviations about the start: they keep Eq. 5 from swallowing everything. Physical: as far as
# published screens' laws differ.
LOG_RATE_SD = 0.7
AMPLITUDE_SD_S = 0.15
PLATEAU_SD_MM_S = 60.0
# The share of the latency by which the speed that counts may seem a later one than the edge's: what a hand's tremor and
# the windows of the speeds leave on sound sessions. Physical.
FOLLOWS_LATER_SD = 0.07
# Flattening of quick changes of speed by a panel's tracker, over that by a window of ``TRACKED_S``. Judgement: with 1
# a lagging law of 0.06 s passes for it.
TRACKED_SD = 0.5
# Speed lost where the path turns, over what the size of a mean velocity loses in a window of ``TRACKED_S``. Physical:
# panels take velocities over about 20 ms (fact sheet on real screens).
TURNED_SD = 0.25
PLATEAUS_MM_S = (20.0, 400.0)  # that a fit allows. Physical: slower nobody drags, faster the law is flat
LEAST_AMPLITUDE_S = 1e-4  # Eq. 5 falls with speed; a law that does not is not this one. Derived
LEAST_BEGUN_S = 1e-3  # of an amplitude where a search begins: at none its rate has no slope. Derived
# Bounds: beyond them an exponential is straight, or over, at any drag. Derived.
LEAST_RATE_S_MM, MOST_RATE_S_MM = 3e-4, 0.15
# Largest step of a search, ln of a rate (a factor of two) and mm/s of a plateau. Derived: what a tangent follows.
MOST_LOG_RATE, MOST_PLATEAU_MM_S = 0.7, 25.0
BENT_SD_S2 = 3e-5  # as a low-pass of some 8 ms bends. Physical
CORNER = 0.02  # of the plateau's speed, over which its corner is rounded. Derived: steps of a search need a slope
N_NUISANCES = 4  # the last base columns: fitted at every step, never carried. Derived


@dataclass(frozen=True)
class LawParameters:
    """Eq. 5 with a3 = a6 = 0. plateau_mm_s: below it L is constant; 0: none."""

    a1_s: float
    a2_s_mm: float
    a4_s: float
    a5_s_mm: float
    a7_s: float
    plateau_mm_s: float = 0.0

    def __call__(self, speed_mm_s: FloatArray) -> FloatArray:
        v = self.counted_mm_s(speed_mm_s)
        return self.a1_s * np.exp(-self.a2_s_mm * v) + self.a4_s * np.exp(-self.a5_s_mm * v) + self.a7_s

    def columns(self, speed_mm_s: FloatArray) -> FloatArray:
        """∂L/∂(a1, ln a2, a4, ln a5, a7[, plateau]), (m, 5 or 6) s."""
        v, below = self._held(speed_mm_s)
        slow, fast = np.exp(-self.a2_s_mm * v), np.exp(-self.a5_s_mm * v)
        out = [
            slow,
            -self.a1_s * self.a2_s_mm * v * slow,
            fast,
            -self.a4_s * self.a5_s_mm * v * fast,
            np.ones_like(v),
        ]
        if self.plateau_mm_s > 0:
            slope = -self.a1_s * self.a2_s_mm * slow - self.a4_s * self.a5_s_mm * fast
            out.append(slope * below)
        return np.column_stack(out)

    @property
    def remainder_s(self) -> tuple[float, ...]:
        """What is added to Eq. 5: nothing."""
        return ()

    @property
    def step_sd(self) -> tuple[float, ...]:
        """Prior standard deviations, as in ``columns``."""
        plateau = (PLATEAU_SD_MM_S,) if self.plateau_mm_s > 0 else ()
        return AMPLITUDE_SD_S, LOG_RATE_SD, AMPLITUDE_SD_S, LOG_RATE_SD, AMPLITUDE_SD_S, *plateau

    def counted_mm_s(self, speed_mm_s: FloatArray) -> FloatArray:
        """The speed, at least the plateau's."""
        return self._held(speed_mm_s)[0] if self.plateau_mm_s > 0 else speed_mm_s

    def _held(self, speed_mm_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Argument with a rounded corner, and its derivative by the plateau's speed."""
        if self.plateau_mm_s <= 0:
            return speed_mm_s, np.zeros_like(speed_mm_s)
        width = CORNER * self.plateau_mm_s
        z = (speed_mm_s - self.plateau_mm_s) / width
        above = np.logaddexp(0.0, z)
        return self.plateau_mm_s + width * above, expit(-z) + CORNER * (above - z * expit(z))

    @property
    def at_bounds(self) -> np.ndarray:
        """Which of a1, a2, a4, a5 are at a bound, (4,)."""
        small = [a <= LEAST_AMPLITUDE_S for a in (self.a1_s, self.a4_s)]
        ends = [not LEAST_RATE_S_MM < rate < MOST_RATE_S_MM for rate in (self.a2_s_mm, self.a5_s_mm)]
        return np.array([small[0], ends[0], small[1], ends[1]])

    @property
    def step_limits(self) -> tuple[FloatArray, FloatArray]:
        """Least and largest step, as in ``columns``, of Eq. 5 and the plateau, (5,) or (6,) each."""
        rates = np.array([self.a2_s_mm, self.a5_s_mm])
        slower = np.maximum(np.log(LEAST_RATE_S_MM / rates), -MOST_LOG_RATE)
        faster = np.minimum(np.log(MOST_RATE_S_MM / rates), MOST_LOG_RATE)
        least = [LEAST_AMPLITUDE_S - self.a1_s, slower[0], LEAST_AMPLITUDE_S - self.a4_s, slower[1], -np.inf]
        most = [np.inf, faster[0], np.inf, faster[1], np.inf]
        if self.plateau_mm_s > 0:
            ends = np.array(PLATEAUS_MM_S) - self.plateau_mm_s
            least.append(max(ends[0], -MOST_PLATEAU_MM_S))
            most.append(min(ends[1], MOST_PLATEAU_MM_S))
        return np.minimum(least, 0.0), np.maximum(most, 0.0)

    def moved(self, step: FloatArray) -> Self:
        """Law after a step as in ``columns``, within its limits."""
        least, most = self.step_limits
        a1_s, a2, a4_s, a5, a7_s, *plateau_mm_s = np.clip(step[: least.size], least, most).tolist()
        return replace(
            self,
            a1_s=max(self.a1_s + a1_s, LEAST_AMPLITUDE_S),
            a2_s_mm=float(np.clip(self.a2_s_mm * np.exp(a2), LEAST_RATE_S_MM, MOST_RATE_S_MM)),
            a4_s=max(self.a4_s + a4_s, LEAST_AMPLITUDE_S),
            a5_s_mm=float(np.clip(self.a5_s_mm * np.exp(a5), LEAST_RATE_S_MM, MOST_RATE_S_MM)),
            a7_s=self.a7_s + a7_s,
            plateau_mm_s=self.plateau_mm_s + sum(plateau_mm_s),
        )


def starting_law(runs: tuple[RunData, ...], less_s: FloatArray | None, plateau: bool) -> LawParameters:
    """Eq. 5 through the runs' latencies less ``less_s``. Raises EstimateError for too few."""
    rows = []
    for k, data in enumerate(runs):
        e = data.estimate
        if e is None or e.latency_s is None or e.speed_mm_s is None or not e.curve_se_s:
            continue
        rows.append((e.speed_mm_s, e.latency_s - (0.0 if less_s is None else less_s[k]), np.hypot(e.curve_se_s, 3e-4)))
    points = CurvePoints(*np.array(rows, float).reshape(-1, 3).T)
    if points.speed_mm_s.size < 5:
        raise EstimateError(
            message("runs that give a latency: {n}, at least 5 are needed", n=points.speed_mm_s.size),
            "See with draglag analyze why the others give none, or record runs at more speeds",
        )
    if points.speed_mm_s.size < (6 if plateau else 5):
        raise EstimateError("too few speeds", "Record runs at more speeds")
    law = eq5_through(points, plateau)
    return replace(law, a1_s=max(law.a1_s, LEAST_BEGUN_S), a4_s=max(law.a4_s, LEAST_BEGUN_S))


def eq5_through(points: CurvePoints, plateau: bool = False) -> LawParameters:
    """Least-squares Eq. 5, of whatever asymptote: the latency of a clock that is off may be negative."""
    shift = max(0.0, 0.02 - float(points.latency_s.min()))
    points = replace(points, latency_s=points.latency_s + shift)
    v = fit_form(points, "double_exponential_plateau" if plateau else "double_exponential").parameters
    return LawParameters(
        max(1e-3 * v["a1_ms"], LEAST_AMPLITUDE_S),
        v["a2_s_per_mm"],
        max(1e-3 * v["a4_ms"], LEAST_AMPLITUDE_S),
        v["a5_s_per_mm"],
        1e-3 * v["a7_ms"] - shift,
        v.get("plateau_mm_s", 0.0),
    )


@dataclass(frozen=True)
class Geometry:
    """Beam y = slope · x + intercept; the stylus' diameter."""

    slope: float
    intercept_mm: float
    diameter_mm: float


def residual_mm(placed: Placed, geometry: Geometry) -> FloatArray:
    """n·p(t + L) − b − s·D/2 at each edge, positive downwards."""
    norm = np.hypot(1.0, geometry.slope)
    across = (placed.xy_mm[:, 1] - geometry.slope * placed.xy_mm[:, 0] - geometry.intercept_mm) / norm
    return np.asarray(across - 0.5 * geometry.diameter_mm * side_of(placed))


def side_of(placed: Placed) -> FloatArray:
    """−1 top, +1 bottom."""
    return sides(placed.falling, placed.v_mm_s[:, 1])


def base_columns(placed: Placed, law: LawParameters) -> FloatArray:
    """Derivatives of the residual by law, beam and nuisances, (m, law's + 6)."""
    v_n = placed.v_mm_s[:, 1] * placed.stretch
    columns = v_n[:, None] * law.columns(placed.speed_mm_s)
    x = placed.xy_mm[:, 0]
    # The share of the latency by which the law's speed is a later one: a nuisance, bounded by its prior.
    lag = v_n * placed.slope_s2_mm * placed.accel_apart_mm_s2 * np.maximum(placed.latency_s, 0.0)
    # A panel's tracker takes the speed from a window, which flattens quick changes, not those from run to run: another.
    tracked = v_n * placed.slope_s2_mm * placed.tracked_mm_s
    # One that takes the size of a mean velocity loses some where the path turns, to second order: a third.
    lost_mm_s = 0.5 * placed.speed_mm_s * (TRACKED_S * placed.turn_rad_s) ** 2
    turned = -v_n * placed.slope_s2_mm * lost_mm_s
    # The position fits themselves bend a fast circle inwards a little: a fourth.
    bent = placed.a_mm_s2[:, 1]
    return np.column_stack([columns, -x, -np.ones_like(x), lag, tracked, turned, bent])


def nuisances(law: LawParameters) -> slice:
    """Places of the nuisances, the last of the base parameters."""
    end = base_prior(law).size
    return slice(end - N_NUISANCES, end)


def base_prior(law: LawParameters) -> FloatArray:
    """Prior precision of a step of each base parameter."""
    sd = [FOLLOWS_LATER_SD, TRACKED_SD, TURNED_SD, BENT_SD_S2]
    return np.concatenate([1 / np.square(law.step_sd), [0.0, 0.0], 1 / np.square(sd)])
