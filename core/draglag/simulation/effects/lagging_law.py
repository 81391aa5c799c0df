"""The latency follows an older speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Confounder, Effect, Parameter
from draglag.simulation.kinematics import Kinematics
from draglag.simulation.residual import LineGains, Signature, View, column


@dataclass(frozen=True)
class LaggingLaw(Effect):
    """The latency follows an older speed."""

    id: ClassVar[str] = "lagging_law"
    meaning: ClassVar[str] = (
        "The latency follows the speed the stylus had some time before, not the speed at the reported position."
    )
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
        present = past * view.latency_s / 0.05
        return [Signature(latency=column(c), theta=(k,), n_grid=2) for k, c in enumerate((past, present))]
