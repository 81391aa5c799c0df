"""The digitiser's latency settles while it warms up."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Effect
from draglag.simulation.effects.fitted_shape import FittedShape
from draglag.simulation.effects.in_fits import Z95, FittedTerm, Parameters, Theta
from draglag.simulation.effects.parameter import Parameter
from draglag.simulation.kinematics import Kinematics
from draglag.simulation.residual import LineGains, Signature, View, column

if TYPE_CHECKING:
    from draglag.gap.fitting.joint import Fit
    from draglag.gap.fitting.state import Term

TIMES_S = 100.0 * 1.25 ** np.arange(18)  # to 4400 s; half a step off, an amplitude of 10 ms is off by 0.4 ms
LOG_TIME_SD = 0.7  # prior standard deviation of a time constant's logarithm: a factor of two


@dataclass(frozen=True)
class WarmUp(Effect):
    id: ClassVar[str] = "warm_up"
    title: ClassVar[str] = "warm-up"
    meaning: ClassVar[str] = (
        "The latency is larger by this much when the session begins and settles exponentially, for taps as for drags."
    )
    follows: ClassVar[str] = "session_time"
    where: ClassVar[str] = "fading with session time"
    separated_by: ClassVar[str] = "a session three times as long: a latency that settles stops, a drift goes on"
    undone_in: ClassVar[str] = "touch"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("amplitude_s", "s", -0.1, 0.1, 0.012),
        Parameter("time_constant_s", "s", 10.0, 5000.0, 500.0, read_as=("s", 1.0)),
    )

    time_constant_s: float = 500.0

    def latency(self, latency_s: FloatArray, k: Kinematics, rng: np.random.Generator) -> FloatArray:
        return latency_s + _settling_s(self.value, self.time_constant_s, k.session_s)

    def tap_latency(self, latency_s: FloatArray, t_s: FloatArray) -> FloatArray:
        return latency_s + _settling_s(self.value, self.time_constant_s, t_s)

    @classmethod
    def signatures(cls, view: View, gains: LineGains | None = None) -> list[Signature]:
        # What takes longer than the session is a straight line in it: a drift, not a latency that settles.
        longest_s = float(np.max(view.since_start_s, initial=0.0))
        seen = [tau for tau in TIMES_S if tau <= longest_s]
        return [Signature(latency=column(np.exp(-view.since_start_s / tau)), theta=(float(tau),)) for tau in seen]

    @classmethod
    def shape_in(cls, term: Term, fit: Fit) -> FittedShape | None:
        """As fitted, which the fit's law goes with; its parameters are a step away."""
        return cls.of_shape(float(term.sizes[0]), term.theta, term.sizes, 0.0)

    @classmethod
    def of_shape(cls, value: float, theta: Theta, sizes: Theta, about: float) -> FittedShape | None:
        return FittedWarmUp(float(sizes[0]), tuple(theta), tuple(sizes), about) if theta and sizes else None

    @classmethod
    def parameters_in(cls, found: FittedTerm) -> Parameters:
        """Amplitude and time constant, by a Gauss–Newton step from the setting."""
        fit, tau = found.fit, found.term.theta[0]
        settled = fit.view.since_start_s / tau
        by_log_tau = Signature(latency=column(found.sizes[0] * settled * np.exp(-settled))).columns(fit.view)
        a, b = fit.white.apply(np.column_stack([fit.design, by_log_tau])), fit.white.apply(fit.residual_mm)
        covariance = np.linalg.pinv(a.T @ a + np.diag([*fit.prior, LOG_TIME_SD**-2]), hermitian=True)
        step, sd = covariance @ (a.T @ b), np.sqrt(np.diag(covariance))
        value, reach = found.sizes[0] + step[found.own][0], Z95 * max(sd[found.own][0], found.se[0])
        amplitude, time_constant = cls.parameters
        times = np.clip(
            tau * np.exp(step[-1] + Z95 * sd[-1] * np.array([0, -1, 1])), time_constant.lower, time_constant.upper
        )
        return {
            amplitude.name: (float(value), (float(value - reach), float(value + reach))),
            time_constant.name: (float(times[0]), (float(times[1]), float(times[2]))),
        }


@dataclass(frozen=True)
class FittedWarmUp(FittedShape):
    """value: amplitude, s. theta: time constant, s."""

    def numbers(self) -> dict[str, float]:
        return {"amplitude_s": float(self.value), "time_constant_s": float(self.theta[0])}

    def latency(self, latency_s: FloatArray, k: Kinematics, rng: np.random.Generator) -> FloatArray:
        return latency_s + _settling_s(self.value, self.theta[0], k.session_s)

    def tap_latency(self, latency_s: FloatArray, t_s: FloatArray) -> FloatArray:
        return latency_s + _settling_s(self.value, self.theta[0], t_s)


def _settling_s(amplitude_s: float, time_constant_s: float, t_s: FloatArray) -> FloatArray:
    return np.asarray(amplitude_s * np.exp(-t_s / time_constant_s))
