"""How an effect moves the residual of an edge."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Protocol, Self

import numpy as np
from scipy.sparse import csr_matrix

from draglag.recording import FloatArray

LineGains = Callable[[FloatArray], FloatArray]
"""Of columns (m, 2 k), how much each pair gains on the white residual, (k,)."""


class Trace(Protocol):
    """The touch trace about m edges."""

    def acceleration(self, lag_s3_mm: float, window_s: float) -> tuple[FloatArray, FloatArray]:
        """Tangential acceleration of the stylus and its rate, (m,) mm/s² and mm/s³, if the latency grows by
        ``lag_s3_mm`` times it. window_s: of the panel's smoothing of speeds."""
        ...

    def accelerated(self, lag_s3_mm: float, window_s: float) -> Self:
        """Trace with this ``acceleration`` known."""
        ...

    def earlier(self, before_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Shown speed and its rate ``before_s`` (m,) before each edge, (m,) mm/s and mm/s²."""
        ...

    def __getitem__(self, use: np.ndarray) -> Trace: ...


@dataclass(frozen=True)
class View:
    """Motion at each edge, (m,); across the beam is positive downwards."""

    x_mm: FloatArray
    y_mm: FloatArray
    side: FloatArray
    rising: FloatArray
    v_across: FloatArray
    speed: FloatArray
    accel: FloatArray
    a_across: FloatArray
    turn_rad_s: FloatArray  # of the direction, in runs of constant speed; else 0
    since_start_s: FloatArray
    in_run_s: FloatArray
    steady: np.ndarray  # (m,) bool, in a run of constant speed
    latency_s: FloatArray
    law_slope: FloatArray
    stretch: FloatArray
    angle: FloatArray
    width_mm: float
    panel_x: FloatArray  # −1 … +1 over the panel
    session_time: FloatArray  # −1 … +1 over the session
    span_s: float
    intercept_mm: float
    averaged: Averaged
    trace: Trace
    law: Callable[[FloatArray], FloatArray]  # latency, s, at a speed, mm/s


@dataclass(frozen=True)
class Averaged:
    """Weights of all events (n,) in the edges, computed on demand.

    x_mm, y_mm: smooth path at the events. t_s, xy_mm: events of all runs in sequence, (n,), (n, 2).
    """

    weights: Callable[[], csr_matrix]
    x_mm: FloatArray
    y_mm: FloatArray
    t_s: FloatArray
    xy_mm: FloatArray

    @cached_property
    def rows(self) -> csr_matrix:
        """(m, n)"""
        return self.weights()

    def __getitem__(self, use: np.ndarray) -> Averaged:
        return Averaged(partial(_taken, self, use), self.x_mm, self.y_mm, self.t_s, self.xy_mm)


def _taken(averaged: Averaged, use: np.ndarray) -> csr_matrix:
    return averaged.rows[use]


@dataclass(frozen=True)
class Signature:
    """Columns (m, k) of an effect at one non-linear setting ``theta``.

    latency: s per unit. offset: mm across the beam per unit. share: of the effect's prior probability; None: equal.
    """

    latency: FloatArray | None = None
    offset: FloatArray | None = None
    theta: tuple[float, ...] = ()
    share: float | None = None

    def columns(self, view: View) -> FloatArray:
        """Residual of the unmodelled effect, (m, k) mm per unit."""
        parts = []
        if self.latency is not None:
            parts.append(-(view.v_across * view.stretch)[:, None] * self.latency)
        if self.offset is not None:
            parts.append(self.offset)
        return parts[0] if len(parts) == 1 else parts[0] + parts[1]


def bent(
    view: View, per_s2: FloatArray | float, late_s: FloatArray | float = 0.0, theta: tuple[float, ...] = ()
) -> Signature:
    """Signature of a path displaced by ``per_s2`` times its acceleration, with the law at the stylus' own speed.
    late_s: further latency."""
    slower_mm_s = per_s2 * view.turn_rad_s**2 * view.speed
    return Signature(column(late_s + view.law_slope * slower_mm_s), column(per_s2 * view.a_across), theta)


def column(values: FloatArray) -> FloatArray:
    """(m,) as (m, 1)."""
    return values[:, None]
