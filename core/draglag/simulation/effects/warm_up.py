"""The digitiser's latency settles while it warms up."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Confounder, Effect, Parameter
from draglag.simulation.kinematics import Kinematics
from draglag.simulation.residual import LineGains, Signature, View, column

TIMES_S = (120.0, 250.0, 500.0, 1000.0)


@dataclass(frozen=True)
class WarmUp(Effect):
    """The digitiser's latency settles while it warms up."""

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
        Parameter("time_constant_s", "s", 10.0, 5000.0, 500.0),
    )
    confounded_with: ClassVar[tuple[Confounder, ...]] = (
        Confounder(
            "thermal_drift",
            "within less than its time constant a latency that settles is all but a straight line",
            "a session of three time constants",
        ),
        Confounder(
            "clock_drift",
            "within less than its time constant a latency that settles is all but a straight line",
            "taps before and after the runs, or clock comparisons: a laser clock that drifts leaves taps alone",
        ),
    )

    time_constant_s: float = 500.0

    def _extra_s(self, t_s: FloatArray) -> FloatArray:
        return np.asarray(self.value * np.exp(-t_s / self.time_constant_s))

    def latency(self, latency_s: FloatArray, k: Kinematics, rng: np.random.Generator) -> FloatArray:
        return latency_s + self._extra_s(k.session_s)

    def tap_latency(self, latency_s: FloatArray, t_s: FloatArray) -> FloatArray:
        return latency_s + self._extra_s(t_s)

    @classmethod
    def signatures(cls, view: View, gains: LineGains | None = None) -> list[Signature]:
        # What takes longer than the session is a straight line in it: a drift, not a latency that settles.
        longest_s = float(np.max(view.since_start_s, initial=0.0))
        seen = [tau for tau in TIMES_S if tau <= longest_s]
        return [Signature(latency=column(np.exp(-view.since_start_s / tau)), theta=(tau,)) for tau in seen]
