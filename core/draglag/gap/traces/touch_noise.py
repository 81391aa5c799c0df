"""Covariance of edges by noise of the touch events."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_matrix, identity

from draglag.recording import FloatArray, IntArray

if TYPE_CHECKING:
    from draglag.gap.traces.edges import Placed
    from draglag.gap.traces.run_data import RunData


@dataclass(frozen=True)
class TouchNoise:
    """Covariances of edges that share events, (k,); first ≤ second: indices."""

    first: IntArray
    second: IntArray
    mm2: FloatArray

    def variance_mm2(self, m: int) -> FloatArray:
        """Variance of each edge, (m,)."""
        own = self.first == self.second
        return np.asarray(np.bincount(self.first[own], self.mm2[own], m))

    def band_mm2(self, use: np.ndarray, reach: int) -> FloatArray:
        """Lower band (reach, used): row j holds edges i and i + j."""
        place = np.cumsum(use) - 1
        inside = use[self.first] & use[self.second]
        first, second = place[self.first[inside]], place[self.second[inside]]
        # Windows are shorter than the memory of a speed, so that edges that share events are within the band.
        near = second - first < reach
        count = int(np.count_nonzero(use))
        flat = (second - first)[near] * count + first[near]
        return np.asarray(np.bincount(flat, self.mm2[inside][near], reach * count).reshape(reach, count), float)


def touch_noise(placed: Placed) -> TouchNoise:
    """Covariances of all placed edges."""
    parts = []
    for rows in _rows(placed):
        pairs = (rows @ rows.T).tocoo()
        below = pairs.row >= pairs.col
        parts.append((pairs.col[below].astype(np.int64), pairs.row[below].astype(np.int64), pairs.data[below]))
    return TouchNoise(*(np.concatenate(each) for each in zip(*parts, strict=True)))


def _rows(placed: Placed) -> tuple[csr_matrix, csr_matrix]:
    """Shift by noise of each event in y and in x, (m, events)."""
    velocity, noise_mm = placed.v_mm_s, placed.traces.noise_mm
    shown = np.maximum(np.hypot(velocity[:, 0], velocity[:, 1]), 1e-6)
    # A speed error moves L by L′ and the edge by v_n L′; direction cosines of the motion split it by axis.
    leverage = velocity[:, 1] * placed.slope_s2_mm * placed.stretch
    along_y, along_x = (leverage * velocity[:, axis] / shown for axis in (1, 0))
    place = _scaled(placed.position_rows, noise_mm)
    across, along = (_scaled(placed.velocity_rows, noise_mm * cosine) for cosine in (along_y, along_x))
    spread = placed.traces.spread
    return (place + across, along) if spread is None else ((place + across) @ spread, along @ spread)


def _scaled(rows: csr_matrix, by: FloatArray) -> csr_matrix:
    return csr_matrix((rows.data * np.repeat(by, np.diff(rows.indptr)), rows.indices, rows.indptr), shape=rows.shape)


def spread_of(runs: Sequence[RunData]) -> csr_matrix | None:
    """Influence of shown events on those of all runs; None if equal."""
    if all(data.spread is None for data in runs):
        return None
    each = [identity(d.t_s.size, format="csr") if d.spread is None else d.spread for d in runs]
    # scipy's block_diag goes through coordinates, and is slow.
    columns, values = (np.cumsum([0, *sizes]) for sizes in ([e.shape[1] for e in each], [e.nnz for e in each]))
    ends = [e.indptr[1:] + before for e, before in zip(each, values, strict=False)]
    index = [e.indices + before for e, before in zip(each, columns, strict=False)]
    parts = np.concatenate([e.data for e in each]), np.concatenate(index), np.concatenate([[0], *ends])
    return csr_matrix(parts, shape=(sum(e.shape[0] for e in each), int(columns[-1])))
