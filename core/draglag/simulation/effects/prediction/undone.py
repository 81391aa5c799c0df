"""Exact inverse of the extrapolation, event by event."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from scipy.linalg.lapack import dtbtrs
from scipy.sparse import csr_matrix, diags, identity

from draglag.path.events import first_of_contact
from draglag.recording import FloatArray, IntArray
from draglag.simulation.effects.in_fits import UndoneTrace
from draglag.simulation.effects.prediction.extrapolation import window_start

if TYPE_CHECKING:
    from draglag.gap.traces.run_data import RunData

LITTLE_NOISE = 0.01  # weight of an earlier event, below which its noise adds 1e-4 of the variance


@dataclass(frozen=True)
class Unpredicted:
    """Undoing of an extrapolation. Stamps move earlier by the horizon, so that the latency stays."""

    horizon_s: float
    window_s: float

    place: ClassVar[int] = -1  # the last that happened to the events
    of_events: ClassVar[bool] = True

    def undo(self, trace: UndoneTrace, shown: RunData, first_s: float) -> UndoneTrace:
        behind = Behind.of(trace.t_s, self.horizon_s, self.window_s)
        spread = behind.weights()
        whole = spread if trace.spread is None else spread @ trace.spread
        return replace(trace, t_s=trace.t_s - self.horizon_s, xy_mm=behind.before(trace.xy_mm), spread=whole)


@dataclass(frozen=True)
class Behind:
    """Reported r = y + g (y − B y) of positions y, B the path a window ago, g horizon over span; (n,).

    begin, share: B y lies between events ``begin`` and the next. gain: g, 0 for the first events of contacts.
    """

    begin: IntArray
    share: FloatArray
    gain: FloatArray

    @classmethod
    def of(cls, t_s: FloatArray, horizon_s: float, window_s: float) -> Behind:
        first = first_of_contact(t_s)
        begins, each = np.flatnonzero(first), np.split(np.arange(t_s.size), np.flatnonzero(first)[1:])
        found = [window_start(t_s[own], window_s) for own in each]
        begin, share, span_s = (np.concatenate(parts) for parts in zip(*found, strict=True))
        begin += np.repeat(begins, [own.size for own in each])
        return cls(begin.astype(np.int64), share, np.where(first, 0.0, horizon_s / span_s))

    def before(self, xy_mm: FloatArray) -> FloatArray:
        """Positions (n, 2) before the extrapolation, of reported ones: a triangular banded system."""
        later = np.flatnonzero(self.gain)
        begin, share, gain = self.begin[later], self.share[later], self.gain[later]
        bands = np.zeros((int(np.max(later - begin, initial=0)) + 1, self.gain.size), order="F")
        bands[0] = 1 + self.gain
        bands[later - begin, begin] -= gain * (1 - share)
        bands[later - begin - 1, begin + 1] -= gain * share
        return np.asarray(dtbtrs(bands, np.asfortranarray(xy_mm), uplo="L")[0], float)

    def weights(self) -> csr_matrix:
        """Weights (n, n) of reported positions, small ones left out: a series y = G r + (I − G) B y, G = 1/(1 + g)."""
        n = self.gain.size
        later = np.flatnonzero(self.gain)
        begin, share = self.begin[later], self.share[later]
        entries = np.concatenate([1 - share, share]), (np.tile(later, 2), np.concatenate([begin, begin + 1]))
        again = diags(self.gain / (1 + self.gain), format="csr") @ csr_matrix(entries, (n, n))
        total = identity(n, format="csr")
        while again.nnz:
            total = _without_little(total + again @ total)
            again = _without_little(again @ again)
        return csr_matrix(total @ diags(1 / (1 + self.gain)))


def _without_little(weights: csr_matrix) -> csr_matrix:
    weights.data[abs(weights.data) < LITTLE_NOISE] = 0.0
    weights.eliminate_zeros()
    return weights
