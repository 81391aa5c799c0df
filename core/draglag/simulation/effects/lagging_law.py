"""The latency follows an older speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Confounder, Effect, Parameter
from draglag.simulation.kinematics import Kinematics
from draglag.simulation.residual import LineGains, Signature, View, column

USUAL_LATENCY_S = 0.05  # a delay of minus this is the present speed


@dataclass(frozen=True)
class LaggingLaw(Effect):
    """The latency follows an older speed."""

    id: ClassVar[str] = "lagging_law"
    meaning: ClassVar[str] = (
        "The latency follows the speed the stylus had some time before, not the speed at the reported position."
    )
    follows: ClassVar[str] = "acceleration"
    where: ClassVar[str] = "where the speed changes"
    shown_apart_by: ClassVar[str] = "a chirp or step whose speed changes quickly"
    undone_in: ClassVar[str] = "law"
    refitted_by: ClassVar[str] = "draglag.gap.proposing.delays"
    needs: ClassVar[str] = "changing speed"
    unseen_without: ClassVar[str] = "a chirp or step whose speed changes quickly"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("delay_s", "s", -0.3, 0.3, 0.04),)
    confounded_with: ClassVar[tuple[Confounder, ...]] = (
        Confounder(
            "acceleration_lag",
            "at a nearly constant acceleration an older speed and a lower speed are the same",
            "runs whose speed changes quickly: chirp and steps",
        ),
    )

    def law_speed(self, speed_mm_s: FloatArray, k: Kinematics) -> FloatArray:
        t = k.motion.t_s
        return np.interp(t - self.value, t, speed_mm_s)

    @classmethod
    def signatures(cls, view: View, gains: LineGains | None = None) -> list[Signature]:
        # A speed some time ago; or (negative) one towards the present, which is a latency later than the edge's own.
        past = -view.law_slope * view.accel
        present = past * view.latency_s / USUAL_LATENCY_S
        return [Signature(latency=column(c), theta=(k,)) for k, c in enumerate((past, present))]

    @classmethod
    def signature_at(cls, theta: tuple[float, ...], view: View) -> Signature:
        """At theta = (which, delay) the law is asked at the speed of that time already: what is left of the delay."""
        if len(theta) < 2:
            return super().signature_at(theta, view)
        which, delay_s = theta
        share = view.latency_s / USUAL_LATENCY_S if which else np.ones(view.latency_s.size)
        _, change = view.trace.earlier(delay_s * share)
        return Signature(latency=column(-view.law_slope * change * share), theta=theta)
