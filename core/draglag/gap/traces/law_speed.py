"""The law's argument, a speed, from the speed that a trace shows.

A trace shows u = v / (1 + L′ ẇ), w being v or its value d before. In the event's time v + τ ẇ = u, τ = −v L′(w).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solveh_banded

from draglag.gap.constants import PADDED_S
from draglag.path.recursion import exponentially_smoothed, recursion
from draglag.recording import FloatArray
from draglag.simulation.law import USUAL_LATENCY_S

if TYPE_CHECKING:
    from draglag.gap.traces.run_data import RunData

Law = Callable[[FloatArray], FloatArray]
SpeedDelay = tuple[float, float]
"""(which, delay_s): the speed of ``delay_s`` before, 0; or 1, of that times the latency over the usual one, so that
minus the usual latency is the speed of the moment of the report."""
NO_DELAY: SpeedDelay = (0.0, 0.0)  # the present speed. Derived
# Steps along a run and passes that solve for the law's speed, which follows a hand of 1 to 4 Hz. Physical.
COARSE_S, PASSES = 0.01, 3
DELAYED_STEP_S, DELAYED_PASSES = 0.03, 3  # the same for another moment's speed, without tremor. Physical
LITTLE_SHOWN = 0.1  # of a change of speed's square: where no more is shown, it is taken for noise. Judgement


def delayed_speeds(runs: Sequence[RunData], law: Law, delay: SpeedDelay) -> list[tuple[FloatArray, FloatArray]]:
    """Times on each trace and the law's argument, (g,)."""
    if delay[1] and runs:
        return _delayed(runs, law, delay)
    steady = iter(_now([data for data in runs if data.steady], law))
    changing = iter(_changing([data for data in runs if not data.steady], law))
    return [next(steady if data.steady else changing) for data in runs]


def delayed_speed_difference(data: RunData, law: Law, delay: SpeedDelay) -> tuple[FloatArray, FloatArray]:
    """Times, and the law's argument less the present speed, (g,)."""
    shown = data.shown
    around = np.maximum(shown.speed_mm_s, 1.0)
    slope = law(around + 0.5) - law(around - 0.5)
    change = np.gradient(shown.speed_mm_s, shown.step_s)
    own = shown.speed_mm_s * (1 + np.clip(slope * change, -0.3, 0.3))
    then = np.interp(shown.grid_s - before_s(delay, law(own)), shown.grid_s, own)
    return shown.grid_s, then - own


def padded(grid_s: FloatArray, speed_mm_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Times (g,), and speeds there and before and after, reflected: what was before a trace began is not known."""
    t_s = np.arange(grid_s[0], grid_s[-1], DELAYED_STEP_S)
    edge = min(round(PADDED_S / DELAYED_STEP_S), t_s.size - 1)
    return t_s, np.pad(np.interp(t_s, grid_s, speed_mm_s), edge, mode="reflect")


def before_s(delay: SpeedDelay, latency_s: FloatArray) -> FloatArray:
    """Time back from edges to the law's speed, (m,)."""
    which, delay_s = delay
    return np.asarray(delay_s * (latency_s / USUAL_LATENCY_S if which else np.ones(np.shape(latency_s))))


def _now(runs: Sequence[RunData], law: Law) -> list[tuple[FloatArray, FloatArray]]:
    """Low-pass with one time constant a run."""
    if not runs:
        return []
    usual = np.array([data.usual_mm_s for data in runs])
    slow = np.maximum(usual - 1.0, 0.0)
    lower, upper = law(np.concatenate([slow, usual + 1.0])).reshape(2, -1)
    out = []
    for data, tau_s in zip(runs, -usual * (upper - lower) / (usual + 1.0 - slow), strict=True):
        grid_s, shown = data.quick
        step_s = grid_s[1] - grid_s[0]
        if tau_s < 0.1 * step_s:
            out.append((grid_s, shown))
            continue
        keep = float(np.exp(-step_s / tau_s))
        speed = exponentially_smoothed(shown, keep)
        out.append((grid_s + 0.5 * step_s, speed))  # each step takes in what is shown at its end
    return out


def _changing(runs: Sequence[RunData], law: Law) -> list[tuple[FloatArray, FloatArray]]:
    """Low-pass by steps that are exact where the shown speed is straight, stable at any size.

    Steps that take it for constant would flatten a hand that changes speed at 4 Hz, as in figure eights, by a tenth.
    """
    if not runs:
        return []
    shown = np.concatenate([data.coarse[1] for data in runs])
    ends = np.cumsum([data.coarse[0].size for data in runs])
    begins = np.append(0, ends[:-1])
    before = np.append(shown[0], shown[:-1])
    knots, falls = _falls(law, float(shown.max()))
    speed = shown
    for _ in range(PASSES):
        share = COARSE_S / np.maximum(speed * np.interp(speed, knots, falls), 1e-3 * COARSE_S)
        kept = np.exp(-share)
        mean = -np.expm1(-share) / share  # of what is kept, over the step
        added = (mean - kept) * before + (1 - mean) * shown
        kept[begins], added[begins] = 0.0, shown[begins]
        speed = recursion(kept, added)
    return [(data.coarse[0], own) for data, own in zip(runs, np.split(speed, ends[:-1]), strict=True)]


def _delayed(runs: Sequence[RunData], law: Law, delay: SpeedDelay) -> list[tuple[FloatArray, FloatArray]]:
    """Least-squares solution of v + τ ẇ = u. v̈ is penalised: near ω d = 3π/2 (−π/2 for later w) τ ẇ cancels v."""
    times, shown = zip(*(data.padded for data in runs), strict=True)
    u = np.concatenate(shown)
    knots, falls = _falls(law, 1.5 * float(u.max()))
    at = np.arange(u.size)
    v = u
    latency_s = law(knots) if delay[0] else np.zeros(knots.size)  # asked for by a share of the latency alone

    def back_s(speed: FloatArray) -> FloatArray:
        return before_s(delay, np.interp(speed, knots, latency_s) if delay[0] else speed)

    delay_s = back_s(u)
    smooth_s4 = LITTLE_SHOWN * (delay_s / np.where(delay_s > 0, 1.5 * np.pi, 0.5 * np.pi)) ** 4
    for _ in range(DELAYED_PASSES):
        back = back_s(v) / DELAYED_STEP_S
        tau = v * np.interp(np.interp(at - back, at, v), knots, falls)
        v = np.maximum(_solved(u, tau / (2 * DELAYED_STEP_S), back, smooth_s4), 0.0)
    w = np.interp(at - back_s(v) / DELAYED_STEP_S, at, v)
    ends = np.cumsum([part.size for part in shown])
    out = []
    for t_s, part, end in zip(times, shown, ends, strict=True):
        edge = (part.size - t_s.size) // 2
        out.append((t_s, w[end - part.size + edge : end - edge]))
    return out


def _solved(u: FloatArray, half_tau: FloatArray, back: FloatArray, smooth_s4: FloatArray) -> FloatArray:
    """Least-squares v (n,) of u = v + half_tau (v[i − back + 1] − v[i − back − 1]). smooth_s4: penalty on v̈²."""
    n = u.size
    row = np.arange(n)
    place = np.clip(row - back, 1.0, n - 2.001)
    first = np.minimum(place.astype(np.int64), n - 3)
    part = place - first
    # The matrix is one and a band: what each row takes from four neighbouring columns.
    taken = half_tau * np.stack([part - 1, -part, 1 - part, part])
    columns = first - 1 + np.arange(4)[:, None]
    off = row - columns
    bands = np.zeros((max(int(np.abs(off).max()), 3) + 1, n))
    bands[0] = 1.0
    size = bands.size
    for of, column, by in zip(taken, columns, off, strict=True):
        flat = np.abs(by) * n + np.minimum(row, column)
        bands += np.bincount(flat, np.where(by == 0, 2 * of, of), size).reshape(bands.shape)
    for i in range(4):
        for j in range(i + 1):
            bands[i - j] += np.bincount(columns[j], taken[i] * taken[j], n)
    stiff = smooth_s4 / DELAYED_STEP_S**4
    before, after = np.append(0.0, stiff[:-1]), np.append(stiff[1:], 0.0)
    bands[0] += before + 4 * stiff + after
    bands[1, :-1] -= 2 * (stiff + after)[:-1]
    bands[2, :-2] += after[:-2]
    given = u + sum(np.bincount(column, of * u, n) for of, column in zip(taken, columns, strict=True))
    return np.asarray(solveh_banded(bands, given, lower=True, check_finite=False))


def _falls(law: Law, fastest_mm_s: float) -> tuple[FloatArray, FloatArray]:
    """Speeds (k,) and −L′ ≥ 0 at each, s²/mm."""
    knots = np.arange(0.0, fastest_mm_s + 2.0)
    slow, fast = np.maximum(knots - 0.5, 0.0), knots + 0.5
    return knots, np.maximum((law(slow) - law(fast)) / (fast - slow), 0.0)
