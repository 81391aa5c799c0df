"""Every usable edge of a session, with the stylus' motion at it under a given latency law."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix

from draglag.events import in_contact, sample_interval_s
from draglag.gap.asked import NOW, Asked, asked_speed, speed_apart
from draglag.gap.run_data import RunData
from draglag.gap.unwarped import Unwarped
from draglag.inversion import slope_of, stylus_speed, stylus_time_s
from draglag.motion import LocalFit, local_fit, speed_half_widths_s
from draglag.recording import FloatArray, IntArray

Law = Callable[[FloatArray], FloatArray]
STRAIGHT_S = 0.001  # so near, a velocity and its rate of change say what a new fit would
THERE_S = 0.0002  # so near, a position does
NEAR_S = 0.004  # so near, the accelerations of a hand are the same
# Half the span of a change of speed and half the window of each speed: beyond the reach of a position's own window; a
# hand speeds up and slows down at 1–3 Hz, its tremor is at 8–12 Hz.
APART_S, WIDTH_S = 0.12, 0.13
FEWEST = 6  # edges a run must give to count


@dataclass(frozen=True)
class Placed:
    """Edges (m,) of all runs, placed on the touch trace by a law.

    Attributes:
        run: index into the runs. t_s: laser time. since_start_s: since the session's first event; in_run_s: since the
        run's. steady: in a run of constant speed. falling: light→dark. latency_s: L at the edge. speed_mm_s: the
        stylus' own speed.
        xy_mm, v_mm_s, a_mm_s2: (m, 2) shown by the trace at t + L. accel_mm_s2: along the motion, in own time.
        accel_apart_mm_s2: the same with an error that is not the position's. change_mm_s2: as the trace shows it.
        sudden: next to a sudden start or stop. looked_s: the touch time that these two were taken at.
        slope_s2_mm: L′. uneven_mm_s: speed less its run's mean, in runs of constant speed; else 0.
        stretch: how much an added latency moves the placing, 1 / (1 − L′ v̇).
        ok: placed well enough to judge by. trace: where on the traces the edges lie.
        position_fit, speed_fit: of each run, at the edges; position_made, speed_made: where they were made, close by.
        events_mm: the path of each run at its touch events, (n, 2).
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
    change_mm_s2: FloatArray
    sudden: np.ndarray
    looked_s: FloatArray
    slope_s2_mm: FloatArray
    uneven_mm_s: FloatArray
    stretch: FloatArray
    ok: np.ndarray
    speed_half_s: FloatArray
    position_fit: tuple[LocalFit, ...]
    speed_fit: tuple[LocalFit, ...]
    position_made: tuple[LocalFit, ...]
    speed_made: tuple[LocalFit, ...]
    events_mm: tuple[FloatArray, ...]
    trace: Unwarped

    def __len__(self) -> int:
        return int(self.t_s.size)


def place(
    runs: tuple[RunData, ...],
    law: Law,
    extra_s: FloatArray | None = None,
    start: Placed | None = None,
    asked: Asked = NOW,
) -> Placed:
    """Solve L = law(v) + extra at every edge. extra_s: (m,) from effects. start: a previous placing to begin from.
    asked: of which moment v is."""
    parts: list[dict[str, np.ndarray]] = []
    position_fits, speed_fits, position_made, speed_made = [], [], [], []
    origin_s = min(run.t_s[0] for run in runs)
    offset = 0
    for k, data in enumerate(runs):
        m = data.edge_t_s.size
        own = slice(offset, offset + m)
        offset += m
        added = 0.0 if extra_s is None else extra_s[own]
        if start is not None:
            latency = start.latency_s[own].copy()
        elif data.steady:
            latency = data.guess_s.copy()
        else:
            # The trace in the stylus' own time: from one constant latency a bell-shaped movement finds wrong roots.
            own_s = stylus_time_s(data.t_s, data.xy_mm, data.t_s, law, max(0.05, 4.5 * sample_interval_s(data.t_s)))
            forwards = np.append(np.diff(own_s) > 0, True)
            latency = np.interp(data.edge_t_s, own_s[forwards], data.t_s[forwards]) - data.edge_t_s
        half_s = data.speed_half_s
        if start is not None:
            half_s = start.speed_half_s[own]
        elif not data.steady:
            half_s = speed_half_widths_s(data.t_s, data.xy_mm, data.edge_t_s + latency, data.noise_mm)
        followed = asked_speed(data, law, asked)
        at_s = data.edge_t_s + latency
        made = local_fit(data.t_s, data.xy_mm, at_s, half_s) if start is None else start.speed_made[k]
        other = None if data.steady or not asked[1] else speed_apart(data, law, asked)
        for _ in range(8):
            if np.max(np.abs(at_s - made.at_s), initial=0) >= STRAIGHT_S:
                made = local_fit(data.t_s, data.xy_mm, at_s, half_s)
            latency, speed, step = _solved(
                made, law, added, data.edge_t_s, 1.0 if data.steady else 0.5, followed, other
            )
            at_s = data.edge_t_s + latency
            if np.max(np.abs(at_s - made.at_s), initial=0) < STRAIGHT_S:
                break
        fast = moved_to(made, at_s)
        if start is not None and np.max(np.abs(at_s - start.position_made[k].at_s), initial=0) < THERE_S:
            there = start.position_made[k]
        else:
            there = local_fit(data.t_s, data.xy_mm, at_s, data.half_s)
        fit = moved_to(there, at_s)
        slope = slope_of(law, speed)
        shown = np.maximum(fast.speed_mm_s, 1e-6)
        ratio = np.maximum(speed, 1e-6) / shown
        along = np.einsum("mk,mk->m", fast.v_mm_s, fast.a_mm_s2) / shown * ratio**2
        # For the columns: with the fit's own, position noise would look like an effect.
        if start is not None and np.max(np.abs(at_s - start.looked_s[own]), initial=0) < NEAR_S:
            change, sudden, looked_s = start.change_mm_s2[own], start.sudden[own], start.looked_s[own]
        else:
            change, sudden, looked_s = _acceleration_apart(data, at_s), _catching_up(data, at_s), at_s
        apart = ratio**2 * change
        across = np.abs(fast.v_mm_s[:, 1])
        ok = fit.ok & fast.ok & in_contact(data.t_s, at_s, data.losses_s) & (fit.gain < 1.5)
        ok &= ~sudden & (across > 0.2 * shown) & (np.abs(slope * along) < 0.3) & (np.abs(step) < 2e-3)
        parts.append(
            {
                "run": np.full(m, k),
                "t_s": data.edge_t_s,
                "since_start_s": data.edge_t_s - origin_s,
                "in_run_s": data.edge_t_s - data.t_s[0],
                "steady": np.full(m, data.steady),
                "falling": data.falling,
                "latency_s": latency,
                "speed_mm_s": speed,
                "xy_mm": fit.xy_mm,
                "v_mm_s": fast.v_mm_s,
                "a_mm_s2": fast.a_mm_s2,
                "accel_mm_s2": along,
                "accel_apart_mm_s2": apart,
                "change_mm_s2": change,
                "sudden": sudden,
                "looked_s": looked_s,
                "slope_s2_mm": slope,
                "uneven_mm_s": speed - np.mean(speed[ok]) if data.steady and ok.any() else np.zeros(m),
                "stretch": 1 / np.clip(1 - slope * apart, 0.7, 1.5),
                "ok": ok,
                "speed_half_s": half_s,
            }
        )
        position_fits.append(fit)
        speed_fits.append(fast)
        position_made.append(there)
        speed_made.append(made)
    joined = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    return Placed(
        **joined,
        position_fit=tuple(position_fits),
        speed_fit=tuple(speed_fits),
        position_made=tuple(position_made),
        speed_made=tuple(speed_made),
        events_mm=tuple(d.smooth_mm for d in runs),
        trace=Unwarped(runs, joined["run"], joined["t_s"] + joined["latency_s"]),
    )


def _solved(
    fast: LocalFit,
    law: Law,
    added_s: FloatArray | float,
    edge_t_s: FloatArray,
    share: float,
    followed: tuple[FloatArray, FloatArray] | None,
    other: tuple[FloatArray, FloatArray] | None,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Latency, stylus' speed and last step, (m,) each, of L = law(v) + added, the trace taken for straight."""
    latency = fast.at_s - edge_t_s
    for _ in range(6):
        at_s = edge_t_s + latency
        if followed is None:
            velocity = fast.v_mm_s + fast.a_mm_s2 * (at_s - fast.at_s)[:, None]
            speed = stylus_speed(law, velocity, fast.a_mm_s2)
            if other is not None:
                speed = np.maximum(speed + np.interp(at_s, *other), 0.0)
        else:
            speed = np.interp(at_s, *followed)
        step = (law(speed) + added_s - latency).clip(-0.02, 0.02)
        step = np.where(fast.ok, share * step, 0.0)
        latency = latency + step
        if np.abs(step).max(initial=0) < 2e-5 or np.abs(edge_t_s + latency - fast.at_s).max(initial=0) > NEAR_S:
            break
    return latency, speed, step


def moved_to(fit: LocalFit, at_s: FloatArray) -> LocalFit:
    """The fit's position and velocity a little beside where it was made; its weights stay."""
    apart_s = (at_s - fit.at_s)[:, None]
    change = fit.a_mm_s2 * apart_s
    return replace(fit, at_s=at_s, xy_mm=fit.xy_mm + (fit.v_mm_s + 0.5 * change) * apart_s, v_mm_s=fit.v_mm_s + change)


def _catching_up(data: RunData, at_s: FloatArray) -> np.ndarray:
    """Edges close to a sudden start or stop, where fresh positions overtake late ones and no law holds, (m,) bool.

    Where L falls faster than time passes a digitiser cannot report in order; what it sends then is its own affair.
    """
    if data.steady:
        return np.zeros(at_s.shape, bool)
    half_s = max(0.045, 4.5 * sample_interval_s(data.t_s))
    around = np.array([-0.1, -0.05, 0.0, 0.05, 0.1])
    fits = [local_fit(data.t_s, data.xy_mm, at_s + shift, half_s) for shift in around]
    speed = np.array([np.where(f.ok, f.speed_mm_s, np.nan) for f in fits])
    slowest, fastest = np.fmin.reduce(speed, axis=0), np.fmax.reduce(speed, axis=0)  # NaN where none is
    return np.asarray(~(slowest > 0.45 * fastest))


def _acceleration_apart(data: RunData, at_s: FloatArray) -> FloatArray:
    """Change of speed about each edge, (m,) mm/s², as the trace shows it, with an error that is not the position's.

    Taken from speeds, not from bent positions, which a fast circle bends far more; each from a window beside the
    position's own, so that the two share no noise, and smooth enough that a tremor, which the law turns into an error
    of the position, is not taken for a change of speed.
    """
    scale = 1.0
    if data.run.radius_mm and data.estimate and data.estimate.speed_mm_s:
        scale = min(1.0, data.run.radius_mm / data.estimate.speed_mm_s / APART_S)
    width_s = max(scale * WIDTH_S, 4.5 * sample_interval_s(data.t_s))
    later, earlier = (
        local_fit(data.t_s, data.xy_mm, at_s + side * scale * APART_S, width_s, degree=2, roundness=3)
        for side in (1, -1)
    )
    change = (later.speed_mm_s - earlier.speed_mm_s) / (2 * scale * APART_S)
    return np.where(later.ok & earlier.ok, change, 0.0)


@dataclass(frozen=True)
class Windows:
    """Weights (m, w) of the events from ``first`` (m,) on."""

    first: IntArray
    weights: FloatArray


def joined_rows(parts: Sequence[tuple[Windows, ...]], n_events: int) -> csr_matrix:
    """Weights of all events, (edges of all parts, n_events); windows of one part are added up, edge by edge."""
    columns, values, counts = [], [], []
    for windows in parts:
        at = [w.first[:, None] + np.arange(w.weights.shape[1]) for w in windows]
        columns.append(np.minimum(np.hstack(at), n_events - 1).ravel())
        values.append(np.hstack([w.weights for w in windows]).ravel())
        counts.append(np.full(windows[0].first.size, sum(w.weights.shape[1] for w in windows)))
    ends = np.concatenate([[0], np.cumsum(np.concatenate(counts))])
    rows = csr_matrix((np.concatenate(values), np.concatenate(columns), ends), shape=(ends.size - 1, n_events))
    rows.sum_duplicates()
    return rows
