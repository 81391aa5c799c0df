"""Edges placed on their traces by a latency law."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from draglag.gap.constants import HAND_STEP_S
from draglag.gap.traces.dewarped import DewarpedKinematics
from draglag.gap.traces.law_speed import NO_DELAY, SpeedDelay, before_s, delayed_speed_difference, delayed_speeds
from draglag.gap.traces.local_fits import Traces, traces_of
from draglag.gap.traces.run_data import RunData
from draglag.gap.traces.touch_noise import TouchNoise, touch_noise
from draglag.path.events import in_contact, sample_interval_s
from draglag.path.inversion import slope_of, stylus_speed, stylus_time_s
from draglag.path.motion import speed_half_widths_s
from draglag.recording import FloatArray, IntArray

Law = Callable[[FloatArray], FloatArray]
STRAIGHT_S = 0.001  # so near, a velocity and its rate of change predict a new fit. Derived
# Standard deviation of the window in which a panel's tracker takes a speed, of several reports at 60 to 120 Hz.
# Calibrated: of 30, 50 and 80 ms the likeliest on 7 of 11 labelled sessions of three generators.
TRACKED_S = 0.03
_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(7)  # exact for polynomials of degree 13. Derived
ROUNDS, STEPS = 8, 6  # of new fits, and between them: a law may lie far off where a fit begins. Derived
EXACT_S = 2e-5  # of a latency: 2 µm at 100 mm/s. Derived
FEW = 0.002  # of all edges that may be left open: another placing goes on with them. Derived: cost


@dataclass(frozen=True)
class Placed:
    """Edges (m,) of all runs, placed on the touch trace by a law.

    t_s: laser time. steady: of a run of constant speed. falling: light→dark. xy_mm, v_mm_s, a_mm_s2: (m, 2) shown at t
    + L. accel_mm_s2: along the motion, in own time; accel_apart_mm_s2: with errors independent of the position's.
    turn_rad_s: of the direction; 0 unless steady. tracked_mm_s: speed in a tracker's window less that of the moment; 0
    where the hand rests. slope_s2_mm: L′. stretch: shift per added latency, 1 / (1 − L′ v̇). position_at_s,
    speed_at_s: times of the fits on ``traces``.
    unsure_s: (runs,) standard deviation of a latency by a state unsure all run long; None: none.
    """

    run: IntArray
    t_s: FloatArray
    since_start_s: FloatArray
    in_run_s: FloatArray
    steady: np.ndarray
    falling: np.ndarray
    latency_s: FloatArray
    speed_mm_s: FloatArray
    xy_mm: FloatArray
    v_mm_s: FloatArray
    a_mm_s2: FloatArray
    accel_mm_s2: FloatArray
    accel_apart_mm_s2: FloatArray
    turn_rad_s: FloatArray
    slope_s2_mm: FloatArray
    tracked_mm_s: FloatArray
    stretch: FloatArray
    ok: np.ndarray
    speed_half_s: FloatArray
    position_at_s: FloatArray
    speed_at_s: FloatArray
    traces: Traces
    trace: DewarpedKinematics
    unsure_s: FloatArray | None = None

    def __len__(self) -> int:
        return int(self.t_s.size)

    @cached_property
    def position_rows(self) -> csr_matrix:
        """Weight of each event in each position, (m, n)."""
        return self.traces.rows(self.position_at_s, self.traces.half_s, lambda by_event: by_event.position)

    @cached_property
    def velocity_rows(self) -> csr_matrix:
        """Weight of each event in each velocity, (m, n) 1/s."""
        return self.traces.rows(self.speed_at_s, self.speed_half_s, lambda by_event: by_event.velocity)

    @cached_property
    def touch_noise(self) -> TouchNoise:
        return touch_noise(self)

    @property
    def touch_variance_mm2(self) -> FloatArray:
        """Variance of each edge by touch noise, (m,)."""
        return self.touch_noise.variance_mm2(len(self))


def place(
    runs: tuple[RunData, ...],
    law: Law,
    extra_s: FloatArray | None = None,
    start: Placed | None = None,
    delay: SpeedDelay = NO_DELAY,
) -> Placed:
    """Solution of L = law(v) + extra. start: earlier placing; delay: of v."""
    traces = traces_of(runs)
    edge_s = traces.edge_t_s
    added_s = np.zeros(edge_s.size) if extra_s is None else extra_s
    law_speeds = _law_speeds(traces, law, delay)
    latency, speed, step, half_s, settled = _found(traces, law, added_s, start, law_speeds)
    at_s = edge_s + latency
    made = traces.speeds.at(at_s, half_s, traces.edges)  # wherever the search came from
    there = traces.positions.at(at_s, traces.half_s, traces.edges)
    xy_mm, _ = _moved(there, at_s)
    _, v_mm_s = _moved(made, at_s)
    a_mm_s2 = made[:, 5:7]
    slope = slope_of(law, speed)
    shown = np.maximum(np.hypot(v_mm_s[:, 0], v_mm_s[:, 1]), 1e-6)
    ratio = np.maximum(speed, 1e-6) / shown
    along = np.einsum("mk,mk->m", v_mm_s, a_mm_s2) / shown * ratio**2
    # For the columns: with the fit's own, position noise would look like an effect.
    change, turn, sudden = traces.changes_at(at_s)
    apart = ratio**2 * change
    ok = settled & _known_at(traces, at_s, there, made)
    ok &= ~sudden & (np.abs(v_mm_s[:, 1]) > 0.2 * shown) & (np.abs(slope * along) < 0.3) & (np.abs(step) < 2e-3)
    run, t_s = traces.run, edge_s - traces.shift_s[traces.run]
    first_s, last_s = np.array([data.t_s[[0, -1]] for data in runs]).reshape(-1, 2).T
    # What speed the law is asked at before a trace begins, or after its end, is not known.
    moment_s = t_s + latency - before_s(delay, latency)
    ok &= (moment_s >= first_s[run]) & (moment_s <= last_s[run])
    judged = ok & traces.steady
    turn = shown * _curvatures(run, judged, turn / shown, len(runs))
    return Placed(
        run=run,
        t_s=t_s,
        since_start_s=t_s - first_s.min(),
        in_run_s=t_s - first_s[run],
        steady=traces.steady,
        falling=traces.falling,
        latency_s=latency,
        speed_mm_s=speed,
        xy_mm=xy_mm,
        v_mm_s=v_mm_s,
        a_mm_s2=np.where(judged[:, None], _accelerations(v_mm_s, change, turn), a_mm_s2),
        accel_mm_s2=along,
        accel_apart_mm_s2=apart,
        turn_rad_s=turn,
        slope_s2_mm=slope,
        tracked_mm_s=_tracked(traces, law_speeds.followed, at_s),
        stretch=1 / np.clip(1 - slope * apart, 0.7, 1.5),
        ok=ok,
        speed_half_s=half_s,
        position_at_s=there[:, 0],
        speed_at_s=made[:, 0],
        traces=traces,
        trace=DewarpedKinematics(runs, run, t_s + latency),
    )


def _known_at(traces: Traces, at_s: FloatArray, there: FloatArray, made: FloatArray) -> NDArray[np.bool_]:
    """(edges,) whether position and speed rest on events near that time, without a loss of contact."""
    ok: NDArray[np.bool_] = (there[:, 7] > 0) & (made[:, 7] > 0) & (there[:, 8] < 1.5)
    ok &= in_contact(traces.t_s, at_s, traces.losses_s)
    return ok


def _found(
    traces: Traces, law: Law, added_s: FloatArray, start: Placed | None, law_speeds: _LawSpeeds
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, NDArray[np.bool_]]:
    """Latency, speed and last step (m,), half windows of the speeds (m,), and which edges lie near their last fit."""
    edge_s = traces.edge_t_s
    if start is not None:
        half_s = start.speed_half_s
        latency = np.where(np.isfinite(start.latency_s), start.latency_s, start.speed_at_s - edge_s)
    else:
        latency, half_s = _begun(traces, law)
    latency, speed, step = latency.copy(), np.zeros(edge_s.size), np.zeros(edge_s.size)
    made = np.empty((edge_s.size, 8))
    open_ = traces.edges
    for _ in range(ROUNDS):
        made[open_] = traces.speeds.at(edge_s[open_] + latency[open_], half_s[open_], open_)
        latency[open_], speed[open_], step[open_] = _solved(
            traces, open_, made[open_], latency[open_], law, added_s[open_], law_speeds
        )
        open_ = open_[np.abs(edge_s[open_] + latency[open_] - made[open_, 0]) >= STRAIGHT_S]
        if open_.size <= (0 if start is None else FEW * edge_s.size):
            break  # a few that come to no end are not worth a round of their own: another placing goes on with them
    return latency, speed, step, half_s, np.abs(edge_s + latency - made[:, 0]) < HAND_STEP_S


def _tracked(traces: Traces, followed: tuple[FloatArray, FloatArray], at_s: FloatArray) -> FloatArray:
    """Law's argument in a tracker's window (Gauss–Hermite quadrature) less that of the moment, (m,)."""
    first_s, last_s = (traces.t_s[at][traces.run] for at in (traces.begin[:-1], traces.begin[1:] - 1))
    around_s = (at_s + TRACKED_S * _NODES[:, None]).clip(first_s, last_s)
    mean = _WEIGHTS @ np.interp(around_s, *followed) / _WEIGHTS.sum()
    return np.where(traces.keeps_moving, mean - np.interp(at_s, *followed), 0.0)


def _curvatures(run: IntArray, judged: np.ndarray, each: FloatArray, n_runs: int) -> FloatArray:
    """Median curvature of the run at judged edges, (m,) rad/mm; else 0."""
    out = np.zeros(run.size)
    for k in range(n_runs):
        own = (run == k) & judged
        if own.any():
            out[own] = np.median(each[own])
    return out


def _accelerations(v_mm_s: FloatArray, change_mm_s2: FloatArray, turn_rad_s: FloatArray) -> FloatArray:
    shown = np.maximum(np.hypot(v_mm_s[:, 0], v_mm_s[:, 1]), 1e-6)
    aside = np.column_stack([-v_mm_s[:, 1], v_mm_s[:, 0]])
    return np.asarray((change_mm_s2 / shown)[:, None] * v_mm_s + turn_rad_s[:, None] * aside)


def _begun(traces: Traces, law: Law) -> tuple[FloatArray, FloatArray]:
    """Initial latencies and half windows, (m,)."""
    latency, half_s = [], []
    for data in traces.runs:
        if data.steady:
            latency.append(data.guess_s)
            half_s.append(data.speed_half_s)
            continue
        # The trace in the stylus' own time: from one constant latency a bell-shaped movement finds wrong roots.
        own_s = stylus_time_s(data.t_s, data.xy_mm, data.t_s, law, max(0.05, 4.5 * sample_interval_s(data.t_s)))
        forwards = np.append(np.diff(own_s) > 0, True)
        late = np.interp(data.edge_t_s, own_s[forwards], data.t_s[forwards]) - data.edge_t_s
        latency.append(late)
        half_s.append(speed_half_widths_s(data.t_s, data.xy_mm, data.edge_t_s + late, data.noise_mm))
    return np.concatenate(latency), np.concatenate(half_s)


@dataclass(frozen=True)
class _LawSpeeds:
    """The law's argument along runs that keep moving, corrections to own speeds elsewhere."""

    followed: tuple[FloatArray, FloatArray]
    apart: tuple[FloatArray, FloatArray] | None


def _law_speeds(traces: Traces, law: Law, delay: SpeedDelay) -> _LawSpeeds:
    each = list(zip(traces.runs, traces.shift_s, strict=True))
    moving = delayed_speeds([data for data, _ in each if data.keeps_moving], law, delay)
    followed = [(t + by, v) for (t, v), by in zip(moving, [by for d, by in each if d.keeps_moving], strict=True)]
    apart = [(delayed_speed_difference(d, law, delay), by) for d, by in each if not d.keeps_moving and delay[1]]
    return _LawSpeeds(_joined(followed) or (np.zeros(1), np.zeros(1)), _joined([(t + by, v) for (t, v), by in apart]))


def _joined(parts: list[tuple[FloatArray, FloatArray]]) -> tuple[FloatArray, FloatArray] | None:
    if not parts:
        return None
    times_s, values = zip(*parts, strict=True)
    return np.concatenate(times_s), np.concatenate(values)


def _solved(
    traces: Traces,
    edges: IntArray,
    fast: FloatArray,
    latency: FloatArray,
    law: Law,
    added_s: FloatArray,
    law_speeds: _LawSpeeds,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Latency, stylus' speed and last step, (q,). fast: (q, 8) fits of the speeds."""
    latency, step, speed = latency.copy(), np.zeros(edges.size), np.zeros(edges.size)
    edge_s, followed = traces.edge_t_s[edges], traces.keeps_moving[edges]
    share = np.where(traces.steady[edges], 1.0, 0.5)
    moving = np.arange(edges.size)
    for _ in range(STEPS):
        at_s = edge_s[moving] + latency[moving]
        now = np.interp(at_s, *law_speeds.followed)
        changing = np.flatnonzero(~followed[moving])
        if changing.size:
            rows = fast[moving[changing]]
            own = stylus_speed(law, _moved(rows, at_s[changing])[1], rows[:, 5:7])
            if law_speeds.apart is not None:
                own = np.maximum(own + np.interp(at_s[changing], *law_speeds.apart), 0.0)
            now[changing] = own
        by_s = share[moving] * (law(now) + added_s[moving] - latency[moving]).clip(-0.02, 0.02)
        by_s = np.where(fast[moving, 7] > 0, by_s, 0.0)
        speed[moving], step[moving] = now, by_s
        latency[moving] += by_s
        moving = moving[(np.abs(by_s) >= EXACT_S) & (np.abs(edge_s + latency - fast[:, 0])[moving] <= HAND_STEP_S)]
        if not moving.size:
            break
    return latency, speed, step


def _moved(rows: FloatArray, at_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Position and velocity next to the fits' times, (m, 2)."""
    apart_s = (at_s - rows[:, 0])[:, None]
    change = rows[:, 5:7] * apart_s
    return rows[:, 1:3] + (rows[:, 3:5] + 0.5 * change) * apart_s, rows[:, 3:5] + change
