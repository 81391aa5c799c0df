"""Undoing of a low-pass in traces."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from scipy.sparse import csr_matrix, identity

from draglag.path.local_fit import LocalFit, local_fit
from draglag.recording import FloatArray
from draglag.simulation.effects.in_fits import UndoneTrace

if TYPE_CHECKING:
    from draglag.gap.traces.run_data import RunData


SOME = 50  # events of a run by which the flattening of its circles is known: they differ in their times only


@dataclass(frozen=True)
class Setting:
    """lag_s: time constant. even: symmetric, not causal."""

    lag_s: float
    even: bool = False

    @classmethod
    def of(cls, theta: tuple[float, ...]) -> Setting | None:
        """Setting of a term; None if nothing is undone."""
        return cls(theta[0], len(theta) > 1) if theta else None

    @property
    def theta(self) -> tuple[float, ...]:
        return (self.lag_s, 1.0) if self.even else (self.lag_s,)


@dataclass(frozen=True)
class Sharpening:
    """Undoing of a low-pass."""

    setting: Setting

    place: ClassVar[int] = 2
    of_events: ClassVar[bool] = False

    def undo(self, trace: UndoneTrace, shown: RunData, first_s: float) -> UndoneTrace:
        half_s = float(np.median(shown.speed_half_s))
        t_s, xy_mm, spread = _sharpened(trace.t_s, trace.xy_mm, self.setting.lag_s, half_s, self.setting.even)
        whole = spread if trace.spread is None else spread @ trace.spread
        return replace(trace, t_s=t_s, xy_mm=xy_mm, spread=whole)


def _sharpened(
    t_s: FloatArray, xy_mm: FloatArray, lag_s: float, half_width_s: float, even: bool
) -> tuple[FloatArray, FloatArray, csr_matrix]:
    """Trace before a low-pass, and weights of events (columns) in those left (rows).

    Causal: u = y + τ ẏ, stamped τ later. Even: u = y − ½ τ² ÿ.
    """
    fit = local_fit(t_s, xy_mm, t_s, half_width_s)
    weights = -0.5 * lag_s**2 * fit.by_event.acceleration if even else lag_s * fit.by_event.velocity
    moved = weights / _gain(fit, t_s, even)
    spread = (identity(t_s.size, format="csr") + fit.rows(moved, t_s.size))[fit.ok]
    return t_s[fit.ok] + (0.0 if even else lag_s), spread @ xy_mm, spread


def _gain(fit: LocalFit, t_s: FloatArray, even: bool) -> float:
    """Share of a circle's velocity, or acceleration (``even``), that local fits keep."""
    v, judged = (fit.v_mm_s @ [1, 1j])[fit.ok], np.flatnonzero(fit.ok)
    if v.size < 2:
        return 1.0
    turn_rad_s = float(np.median(np.angle(v[1:] * np.conj(v[:-1])) / np.diff(t_s[judged])))
    some = judged[:: max(judged.size // SOME, 1)]
    weights = (fit.by_event.acceleration if even else fit.by_event.velocity)[some]
    at = np.minimum(fit.first[some, None] + np.arange(weights.shape[1]), t_s.size - 1)
    turned = np.sum(weights * np.exp(1j * turn_rad_s * (t_s[at] - t_s[some, None])), axis=1)
    true = -(turn_rad_s**2) if even else 1j * turn_rad_s
    return float(np.median((turned / true).real)) if turn_rad_s else 1.0
