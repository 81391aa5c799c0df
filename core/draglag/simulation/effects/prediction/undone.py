"""Exact inverse of the extrapolation, event by event."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from scipy.sparse import csr_matrix, diags, identity

from draglag.path.events import first_of_contact
from draglag.recording import FloatArray
from draglag.simulation.effects.in_fits import UndoneTrace
from draglag.simulation.effects.prediction.extrapolation import window_start

if TYPE_CHECKING:
    from draglag.gap.traces.run_data import RunData

NEGLIGIBLE = 1e-4  # weight of an earlier event: of 1 m of path 0.1 mm would be its offset, of its noise nothing
LITTLE_NOISE = 0.01  # weight of an earlier event, below which its noise adds 1e-4 of the variance


@dataclass(frozen=True)
class Unpredicted:
    """Undoing of an extrapolation. Stamps move earlier by the horizon, so that the latency stays."""

    horizon_s: float
    window_s: float

    place: ClassVar[int] = -1  # the last that happened to the events
    of_events: ClassVar[bool] = True

    def undo(self, trace: UndoneTrace, shown: RunData, first_s: float) -> UndoneTrace:
        exact = inverse(trace.t_s, self.horizon_s, self.window_s)
        spread = exact.copy()
        spread.data[abs(spread.data) < LITTLE_NOISE] = 0.0
        spread.eliminate_zeros()
        whole = spread if trace.spread is None else spread @ trace.spread
        return replace(trace, t_s=trace.t_s - self.horizon_s, xy_mm=exact @ trace.xy_mm, spread=whole)


def inverse(t_s: FloatArray, horizon_s: float, window_s: float) -> csr_matrix:
    """Weights (n, n) of reported positions r in the positions y before the extrapolation.

    r = y + g (y − B y), B the path a window ago, g horizon over span: y = G r + (I − G) B y, G = 1 / (1 + g), a series.
    """
    n = t_s.size
    bounds = np.flatnonzero(first_of_contact(t_s))
    back, gain = csr_matrix((n, n)), np.zeros(n)
    rows, columns, weights = [], [], []
    for own in np.split(np.arange(n), bounds[1:]):
        if own.size < 2:
            continue
        begin, share, span_s = window_start(t_s[own], window_s)
        gain[own] = horizon_s / span_s
        gain[own[0]] = 0.0
        rows += [own, own]
        columns += [own[begin], own[np.minimum(begin + 1, own.size - 1)]]
        weights += [1 - share, share]
    if rows:
        back = csr_matrix((np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns))), (n, n))
    again = diags(gain / (1 + gain), format="csr") @ back
    total = identity(n, format="csr")
    while again.nnz:
        total = total + again @ total
        again = again @ again
        again.data[abs(again.data) < NEGLIGIBLE] = 0.0
        again.eliminate_zeros()
    return csr_matrix(total @ diags(1 / (1 + gain)))
