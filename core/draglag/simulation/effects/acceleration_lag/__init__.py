"""The latency depends on whether the stylus speeds up."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Effect
from draglag.simulation.effects.in_fits import FittedTerm, Theta
from draglag.simulation.effects.parameter import Parameter
from draglag.simulation.kinematics import Kinematics
from draglag.simulation.residual import LineGains, Signature, View, column

if TYPE_CHECKING:
    from draglag.gap.fitting.joint import Fit
    from draglag.gap.fitting.state import Term
    from draglag.gap.traces.edges import Placed
    from draglag.simulation.effects.fitted_shape import FittedShape

LAGS_S3_MM = (0.0, 4e-6, 8e-6, 1.2e-5, 2e-5, 3e-5)  # sizes to begin from
# Standard deviation of the window over which a panel's tracker may smooth the speed that it takes the acceleration of,
# the usual one first. Physical; without the shortest one of 18 sessions with a lag has a second name.
WINDOWS_S = (0.05, 0.03, 0.07, 0.015)
END_S = 0.3  # of a trace: three times what an acceleration behind it remembers
ACCEL_UNKNOWN = 0.2  # share of a speed's change: how smooth it is taken for, no number of edges averages away


class Setting(NamedTuple):
    """lag_s3_mm: size assumed in the trace, s per mm/s²; window_s: of the panel's smoothing of speeds."""

    lag_s3_mm: float = 0.0
    window_s: float = WINDOWS_S[0]


@dataclass(frozen=True)
class AccelerationLag(Effect):
    id: ClassVar[str] = "acceleration_lag"
    meaning: ClassVar[str] = "The latency grows in proportion to the tangential acceleration of the stylus."
    follows: ClassVar[str] = "acceleration"
    where: ClassVar[str] = "where the speed changes"
    separated_by: ClassVar[str] = "a chirp or step whose speed changes quickly"
    undone_in: ClassVar[str] = "law"
    refitted_by: ClassVar[str] = "draglag.simulation.effects.acceleration_lag.refits"
    unsure_share: ClassVar[float] = ACCEL_UNKNOWN
    needs: ClassVar[str] = "changing speed"
    identifiable_with: ClassVar[str] = "a chirp or step whose speed changes quickly"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("lag_s_per_mm_s2", "s per mm/s²", -5e-05, 5e-05, 2e-06, title="lag"),
    )

    def latency(self, latency_s: FloatArray, k: Kinematics, rng: np.random.Generator) -> FloatArray:
        return latency_s + self.value * k.tangential_mm_s2

    @classmethod
    def signatures(cls, view: View, gains: LineGains | None = None) -> list[Signature]:
        # As the trace shows it, amplified by the effect itself: enough to find it. Its own size takes that back.
        return [Signature(latency=column(view.accel), theta=(0.0,), share=1 / len(LAGS_S3_MM))]

    @classmethod
    def signature_at(cls, theta: tuple[float, ...], view: View) -> Signature:
        setting = Setting(*theta)
        if setting.lag_s3_mm <= 0:
            return Signature(latency=column(view.accel), theta=setting._replace(lag_s3_mm=0.0))
        accel, change = view.trace.acceleration(*setting)
        # A trace whose latency grows shows a speed too low, and the law is asked at that speed.
        late = accel + view.law_slope * view.speed * change
        return Signature(latency=column(late), theta=setting)

    @classmethod
    def size_sd(cls, found: FittedTerm) -> float:
        return float(np.hypot(found.se[0], ACCEL_UNKNOWN * abs(found.sizes[0])))

    @classmethod
    def unsure_mm(cls, term: Term, placed: Placed) -> FloatArray:
        """What the run's typical acceleration moves an edge by, (m,), at a trace's ends."""
        at_s = placed.t_s + placed.latency_s
        ends_s = np.array([(data.t_s[0], data.t_s[-1]) for data in placed.traces.runs])[placed.run]
        at_end = ~((at_s > ends_s[:, 0] + END_S) & (at_s < ends_s[:, 1] - END_S))
        square = np.where(np.isfinite(placed.accel_apart_mm_s2), placed.accel_apart_mm_s2, 0.0) ** 2
        edges = np.maximum(np.bincount(placed.run), 1)
        typical_mm_s2 = np.sqrt(np.bincount(placed.run, square) / edges)[placed.run]
        lever_mm_s = np.abs(placed.v_mm_s[:, 1] * placed.stretch)
        return np.asarray(np.where(at_end, abs(term.sizes[0]) * typical_mm_s2 * lever_mm_s, 0.0))

    @classmethod
    def view_with(cls, theta: Theta, view: View) -> View:
        """View with the stylus' acceleration, which the trace hides."""
        setting = Setting(*theta)
        if setting.lag_s3_mm <= 0:
            return view
        trace = view.trace.accelerated(*setting)
        return replace(view, trace=trace, accel=trace.acceleration(*setting)[0])

    @classmethod
    def shape_in(cls, term: Term, fit: Fit) -> FittedShape | None:
        return cls.of_shape(float(term.sizes[0]), term.theta, term.sizes, 0.0)

    @classmethod
    def of_shape(cls, value: float, theta: Theta, sizes: Theta, about: float) -> FittedShape | None:
        from draglag.simulation.effects.acceleration_lag.fitted import SmoothedLag

        return SmoothedLag(value, tuple(Setting(*theta[:2])), tuple(sizes), about)

    @classmethod
    def theta_at(cls, theta: Theta, sizes: Theta) -> Theta:
        """Setting at the size found."""
        return Setting(*theta)._replace(lag_s3_mm=max(sizes[0], 0.0))
