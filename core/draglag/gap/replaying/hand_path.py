"""The stylus' path recovered from a trace."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from draglag.gap.replaying.realised import held_s
from draglag.gap.traces.edges import EXACT_S
from draglag.gap.traces.run_data import RunData
from draglag.path.local_fit import local_fit
from draglag.path.savgol import smoothed
from draglag.recording import FloatArray
from draglag.simulation.digitiser import reporting
from draglag.simulation.effects.base import Effect
from draglag.simulation.kinematics import GRID_HZ, Kinematics, Motion
from draglag.simulation.rig import Rig

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

# Grid points of the simulation between two points of the path that is sought. Derived: 5 ms, a sixteenth of a period of
# tremor.
COARSE = 5
SMOOTHED = 31  # coarse points, about 0.15 s: a hand speeds up and slows down at 1 to 4 Hz. Physical
ROUNDS = 14  # of the inversion: three or four for most effects, 7 to 14 for an acceleration lag. Derived: cost
MOVES = 4  # rounds in which places are moved back: noise that a low-pass lets nothing of through grows. Derived
SETTLED = 0.99  # of the path; ends and gaps do not converge. Derived: cost


def hand_motion(
    rig: Rig, data: RunData, latency_s: FloatArray, effects: Sequence[Effect], origin_s: float
) -> tuple[Motion, float]:
    """Motion on the simulation's grid, and its start in host time. latency_s: (edges,) initial."""
    slowest_s = float(np.max(latency_s)) + 0.05
    start_s = float(data.t_s[0]) - slowest_s
    n = int((data.t_s[-1] - start_s - max(float(np.min(latency_s)), 0.0)) * GRID_HZ / COARSE)
    t = np.arange(n) * COARSE / GRID_HZ
    late = np.interp(t + start_s, data.edge_t_s, latency_s)
    trace_mm, velocity_mm_s = _smoothed_trace(data, float(np.median(latency_s)))
    moved = np.zeros((n, 2))
    quiet = rig.ideal()
    tried: list[tuple[FloatArray, FloatArray]] = []
    for k in range(ROUNDS + 1):
        at_s = np.clip(t + start_s + late, data.t_s[0], data.t_s[-1])
        here = trace_mm(at_s) - moved
        # In the stylus' own time the trace runs at another rate: d(t + L)/dt.
        rate = np.clip(1 + np.gradient(late, t), 0.3, 3.0)
        velocity = velocity_mm_s(at_s) * _smooth(rate)[:, None] - np.gradient(moved, t, axis=0)
        motion = Motion(t, here[:, 0], here[:, 1], velocity[:, 0], velocity[:, 1], np.ones(n, bool))
        if k == ROUNDS:
            break
        kinematics = Kinematics(motion, t + start_s - origin_s, rig.screen.width_mm, rig.screen.height_mm)
        report = reporting(quiet, kinematics, effects, lambda name: np.random.default_rng(0))
        step = report.latency_s + held_s(effects) - late
        if k < MOVES:
            moved = np.column_stack([report.x_mm - motion.x_mm, report.y_mm - motion.y_mm])
            if moved.any() and n > SMOOTHED:
                # A low-pass cannot be undone at frequencies it lets nothing of through: noise would grow every round.
                moved = smoothed(moved, SMOOTHED, 3)
        if (k >= MOVES or not moved.any()) and np.quantile(np.abs(step), SETTLED) < EXACT_S:
            break  # converged as closely as edges are placed
        step = _implicit(step, sum(effect.per_acceleration_s3_mm() for effect in effects) * motion.speed_mm_s)
        tried.append((late, step))
        late = _mixed(tried)
    return _on_the_grid(motion), start_s


def _implicit(step_s: FloatArray, lag_s2: FloatArray) -> FloatArray:
    """Step s (n,) with s − lag_s2 · s″ = step_s: a later point lowers the acceleration that made it late.

    lag_s2: (n,) latency per acceleration times the speed. Explicit steps would grow without end.
    """
    from scipy.linalg import solve_banded

    if not lag_s2.any():
        return step_s
    q = lag_s2 * (GRID_HZ / COARSE) ** 2
    own = 1 + 2 * q
    own[[0, -1]] -= q[[0, -1]]
    return np.asarray(solve_banded((1, 1), np.array([-np.append(0, q[:-1]), own, -np.append(q[1:], 0)]), step_s))


def _mixed(tried: list[tuple[FloatArray, FloatArray]]) -> FloatArray:
    """Next point (n,) of a fixed-point search by Anderson's mixing (1965), from points and their steps."""
    points, steps = (np.array(values) for values in zip(*tried, strict=True))
    if len(tried) == 1:
        return np.asarray(points[0] + steps[0])
    by_point, by_step = np.diff(points, axis=0), np.diff(steps, axis=0)
    share = np.linalg.lstsq(by_step.T, steps[-1], rcond=None)[0]
    return np.asarray(points[-1] + steps[-1] - share @ (by_point + by_step))


def _smoothed_trace(data: RunData, latency_s: float) -> tuple[CubicSpline, CubicSpline]:
    from scipy.interpolate import CubicSpline

    grid_s = np.linspace(data.t_s[0], data.t_s[-1], int(np.ptp(data.t_s) * GRID_HZ / COARSE) + 2)
    near = local_fit(data.t_s, data.xy_mm, grid_s, data.half_s)
    wide = local_fit(data.t_s, data.xy_mm, grid_s, np.interp(grid_s - latency_s, data.edge_t_s, data.speed_half_s))
    return CubicSpline(grid_s, _filled(near.xy_mm, near.ok)), CubicSpline(grid_s, _filled(wide.v_mm_s, wide.ok))


def _filled(values: FloatArray, ok: np.ndarray) -> FloatArray:
    if ok.all() or not ok.any():
        return values
    index = np.arange(ok.size)
    return np.column_stack([np.interp(index, index[ok], column[ok]) for column in values.T])


def _smooth(rate: FloatArray) -> FloatArray:
    """By cubics: a mean over 0.1 s leaves two thirds of what changes at 5 Hz."""
    width = int(0.1 * GRID_HZ / COARSE) | 1
    return smoothed(rate, width, 3) if rate.size > width else rate


def _on_the_grid(motion: Motion) -> Motion:
    """A motion of coarse points on the simulation's grid."""
    from scipy.interpolate import CubicSpline

    t = np.arange((motion.t_s.size - 1) * COARSE + 1) / GRID_HZ
    path = CubicSpline(motion.t_s, np.column_stack([motion.x_mm, motion.y_mm]))(t)
    vx, vy = (np.interp(t, motion.t_s, column) for column in (motion.vx_mm_s, motion.vy_mm_s))
    return Motion(t, path[:, 0], path[:, 1], vx, vy, np.ones(t.size, bool))
