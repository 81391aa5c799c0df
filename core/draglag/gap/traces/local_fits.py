"""Traces of all runs as one, with cached local fits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_matrix

from draglag.gap.traces.run_data import RunData
from draglag.gap.traces.touch_noise import spread_of
from draglag.path.events import sample_interval_s
from draglag.path.local_fit import FitWeights, local_fit
from draglag.recording import FloatArray, IntArray

BETWEEN_S = 10.0  # between the traces of two runs: longer than any window. Derived
# Within half of it, a fit's own motion predicts a new fit. Derived.
POSITION_STEP_S, SPEED_STEP_S = 0.0004, 0.001
CHANGE_STEP_S = 0.008  # between two of which changes of speed, taken in much longer windows, are straight. Derived
# Half the span of a change of speed and half the window of each speed: beyond the reach of a position's own window; a
# hand speeds up and slows down at 1–3 Hz, its tremor is at 8–12 Hz.
# Physical.
APART_S, WIDTH_S = 0.12, 0.13
WIDTH_UNIT_S = 1e-5  # windows closer than this are one. Derived
FURTHEST, WIDEST = (1 << 23) - 1, (1 << 20) - 1  # of what a key can hold: steps, units of a width. Derived
SIZES = 2.0  # windows per doubling of their number of events that are fitted together. Derived: cost

Fitted = Callable[[FloatArray, FloatArray, IntArray], FloatArray]


class Kept:
    """Cache of rows about edges at grid times. make: times, half widths, edges (q,) → rows (q, c), the time first."""

    def __init__(self, make: Fitted, edge_t_s: FloatArray, step_s: float) -> None:
        self._make, self._edge_t_s, self._step_s = make, edge_t_s, step_s
        self._keys, self._row = np.empty(0, np.int64), np.empty(0, np.int64)  # sorted, and which row has it
        self._rows: FloatArray = np.empty((0, 0))
        self._used = 0

    def at(self, at_s: FloatArray, half_s: FloatArray, edges: IntArray) -> FloatArray:
        """Rows (q, c) at the nearest grid times; each edge once."""
        away = np.rint((at_s - self._edge_t_s[edges]) / self._step_s)
        steps = np.clip(np.nan_to_num(away, nan=FURTHEST), -FURTHEST, FURTHEST).astype(np.int64)
        widths = np.minimum(np.rint(half_s / WIDTH_UNIT_S), WIDEST).astype(np.int64)
        keys = (edges << 44) + ((steps + (1 << 23)) << 20) + widths
        where, known = self._found(keys)
        if not known.all():
            new = np.flatnonzero(~known)
            new = new[np.argsort(keys[new])]
            self._add(
                keys[new], self._make(self._edge_t_s[edges[new]] + steps[new] * self._step_s, half_s[new], edges[new])
            )
            where, _ = self._found(keys)
        return np.asarray(self._rows.take(self._row[where], axis=0))

    def _found(self, keys: IntArray) -> tuple[IntArray, np.ndarray]:
        if not self._keys.size:
            return np.zeros(keys.size, np.int64), np.zeros(keys.size, bool)
        where = np.minimum(np.searchsorted(self._keys, keys), self._keys.size - 1)
        return where, self._keys[where] == keys

    def _add(self, keys: IntArray, rows: FloatArray) -> None:
        end = self._used + rows.shape[0]
        if end > self._rows.shape[0]:
            grown = np.empty((2 * end, rows.shape[1]))
            if self._used:
                grown[: self._used] = self._rows[: self._used]
            self._rows = grown
        self._rows[self._used : end] = rows
        at = np.searchsorted(self._keys, keys)
        self._keys = np.insert(self._keys, at, keys)
        self._row = np.insert(self._row, at, np.arange(self._used, end))
        self._used = end


@dataclass(frozen=True, eq=False)
class Traces:
    """All traces in sequence, shifted so that no window covers two.

    t_s, xy_mm: (n,), (n, 2) events. shift_s, begin: (runs,), (runs + 1,) shift and first event. losses_s: (k, 2)
    contact losses and gaps between runs. Others: (m,) of edges, ``edge_t_s`` shifted.
    """

    runs: tuple[RunData, ...]
    t_s: FloatArray
    xy_mm: FloatArray
    shift_s: FloatArray
    begin: IntArray
    losses_s: FloatArray
    run: IntArray
    edge_t_s: FloatArray
    falling: np.ndarray
    steady: np.ndarray
    keeps_moving: np.ndarray
    half_s: FloatArray

    def __getstate__(self) -> dict[str, object]:
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @cached_property
    def edges(self) -> IntArray:
        return np.arange(self.edge_t_s.size)

    @cached_property
    def smooth_mm(self) -> FloatArray:
        return np.concatenate([data.smooth_mm for data in self.runs])

    @cached_property
    def noise_mm(self) -> FloatArray:
        """Noise of an event in the run of each edge, (m,)."""
        return np.array([data.noise_mm for data in self.runs])[self.run]

    @cached_property
    def spread(self) -> csr_matrix | None:
        """See ``spread_of``."""
        return spread_of(self.runs)

    @cached_property
    def positions(self) -> Kept:
        """Rows of at_s, x, y, vx, vy, ax, ay, ok, gain, in a position's window."""
        return Kept(lambda at_s, half_s, _: self._fitted(at_s, half_s, True), self.edge_t_s, POSITION_STEP_S)

    @cached_property
    def speeds(self) -> Kept:
        """Rows like ``positions`` without gain, in a speed's window."""
        return Kept(lambda at_s, half_s, _: self._fitted(at_s, half_s, False), self.edge_t_s, SPEED_STEP_S)

    def changes_at(self, at_s: FloatArray) -> tuple[FloatArray, FloatArray, np.ndarray]:
        """Change of speed (mm/s²), turn (rad/s) and whether near a sudden start or stop, of each edge."""
        none, share = np.zeros(at_s.size), np.nan_to_num((at_s - self.edge_t_s) / CHANGE_STEP_S)
        before = np.floor(share)
        share = (share - before)[:, None]
        # Linear between grid times: steps from one to the next would make the cost of a fit jump.
        one, other = (
            self._kept_changes.at(self.edge_t_s + k * CHANGE_STEP_S, none, self.edges) for k in (before, before + 1)
        )
        _, change, turn, sudden = ((1 - share) * one + share * other).T
        return change, turn, sudden > 0

    @cached_property
    def _kept_changes(self) -> Kept:
        """Rows of at_s, change of speed, turn, near a sudden start or stop."""

        def make(at_s: FloatArray, _: FloatArray, edges: IntArray) -> FloatArray:
            return np.column_stack([at_s, *self._changes(at_s, edges), self._catching_up(at_s, edges)])

        return Kept(make, self.edge_t_s, CHANGE_STEP_S)

    def _fitted(self, at_s: FloatArray, half_s: FloatArray, gain: bool) -> FloatArray:
        out = np.empty((at_s.size, 8 + gain))
        for part in self._alike(at_s, half_s):
            fit = local_fit(self.t_s, self.xy_mm, at_s[part], half_s[part])
            columns = [at_s[part], fit.xy_mm, fit.v_mm_s, fit.a_mm_s2, fit.ok]
            out[part] = np.column_stack([*columns, fit.gain] if gain else columns)
        return out

    def _alike(self, at_s: FloatArray, half_s: FloatArray) -> list[IntArray]:
        first, last = (np.searchsorted(self.t_s, at_s + side * half_s) for side in (-1, 1))
        size = np.round(SIZES * np.log2(np.maximum(last - first, 4)))
        return [np.flatnonzero(size == s) for s in np.unique(size)]

    @cached_property
    def _reach(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Half span of a change of speed, half windows of speeds and of sudden starts."""
        scales, widths, sudden = [], [], []
        for data in self.runs:
            scale, interval_s = 1.0, sample_interval_s(data.t_s)
            if data.run.radius_mm and data.estimate and data.estimate.speed_mm_s:
                scale = min(1.0, data.run.radius_mm / data.estimate.speed_mm_s / APART_S)
            scales.append(scale * APART_S)
            widths.append(max(scale * WIDTH_S, 4.5 * interval_s))
            sudden.append(max(0.045, 4.5 * interval_s))
        return np.array(scales)[self.run], np.array(widths)[self.run], np.array(sudden)[self.run]

    def _changes(self, at_s: FloatArray, edges: IntArray) -> tuple[FloatArray, FloatArray]:
        """Change of speed, turn of the direction (positive from x to y); (q,)."""
        apart_s, width_s = (reach[edges] for reach in self._reach[:2])
        later, earlier = (
            local_fit(self.t_s, self.xy_mm, at_s + side * apart_s, width_s, degree=2, roundness=3) for side in (1, -1)
        )
        known, after, before = later.ok & earlier.ok, later.v_mm_s @ [1, 1j], earlier.v_mm_s @ [1, 1j]
        changes = np.abs(after) - np.abs(before), np.angle(after * np.conj(before))
        speed, direction = (np.where(known, change / (2 * apart_s), 0.0) for change in changes)
        return speed, direction

    def _catching_up(self, at_s: FloatArray, edges: IntArray) -> np.ndarray:
        """Whether near a sudden start or stop, where no law holds."""
        out = np.zeros(at_s.size, bool)
        unsteady = np.flatnonzero(~self.steady[edges])
        if not unsteady.size:
            return out
        half_s = self._reach[2][edges[unsteady]]
        fits = [
            local_fit(self.t_s, self.xy_mm, at_s[unsteady] + aside, half_s) for aside in (-0.1, -0.05, 0.0, 0.05, 0.1)
        ]
        speed = np.array([np.where(f.ok, f.speed_mm_s, np.nan) for f in fits])
        slowest, fastest = np.fmin.reduce(speed, axis=0), np.fmax.reduce(speed, axis=0)  # NaN where none is
        out[unsteady] = ~(slowest > 0.45 * fastest)
        return out

    def rows(self, at_s: FloatArray, half_s: FloatArray, weights: Callable[[FitWeights], FloatArray]) -> csr_matrix:
        """Weight of each event in the fit at each time, (m, n)."""
        index, values, counts, order = [], [], [], []
        for part in self._alike(at_s, half_s):
            fit = local_fit(self.t_s, self.xy_mm, at_s[part], half_s[part])
            each = weights(fit.by_event)
            index.append(np.minimum(fit.first[:, None] + np.arange(each.shape[1]), self.t_s.size - 1).ravel())
            values.append(each.ravel())
            counts.append(np.full(part.size, each.shape[1]))
            order.append(part)
        ends = np.concatenate([[0], np.cumsum(np.concatenate(counts))])
        grouped = csr_matrix((np.concatenate(values), np.concatenate(index), ends), shape=(at_s.size, self.t_s.size))
        return grouped[np.argsort(np.concatenate(order))]


@lru_cache(maxsize=4)
def traces_of(runs: tuple[RunData, ...]) -> Traces:
    """Traces, cached with their fits."""
    spans = np.array([[min(d.t_s[0], d.edge_t_s.min()), max(d.t_s[-1], d.edge_t_s.max())] for d in runs])
    lengths = np.diff(spans, axis=1)[:, 0] + BETWEEN_S
    shift_s = np.concatenate([[0.0], np.cumsum(lengths)[:-1]]) - spans[:, 0]
    t_s = [data.t_s + by for data, by in zip(runs, shift_s, strict=True)]
    between = [[before[-1], after[0]] for before, after in pairwise(t_s)]
    losses = np.concatenate(
        [data.losses_s + by for data, by in zip(runs, shift_s, strict=True)] + [np.reshape(between, (-1, 2))]
    )
    count = [data.edge_t_s.size for data in runs]
    return Traces(
        runs,
        np.concatenate(t_s),
        np.asfortranarray(np.concatenate([data.xy_mm for data in runs])),  # each coordinate in one piece: see local_fit
        shift_s,
        np.concatenate([[0], np.cumsum([data.t_s.size for data in runs])]),
        losses[np.argsort(losses[:, 0])],
        np.repeat(np.arange(len(runs)), count),
        np.concatenate([data.edge_t_s + by for data, by in zip(runs, shift_s, strict=True)]),
        np.concatenate([data.falling for data in runs]),
        np.repeat([data.steady for data in runs], count),
        np.repeat([data.keeps_moving for data in runs], count),
        np.repeat([data.half_s for data in runs], count),
    )
