"""The latency depends on whether the stylus speeds up."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Confounder, Effect, Parameter
from draglag.simulation.kinematics import Kinematics


@dataclass(frozen=True)
class AccelerationLag(Effect):
    """The latency depends on whether the stylus speeds up."""

    id: ClassVar[str] = "acceleration_lag"
    meaning: ClassVar[str] = "The latency grows in proportion to the tangential acceleration of the stylus."
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("lag_s_per_mm_s2", "s per mm/s²", -2e-05, 2e-05, 2e-06),)
    confounded_with: ClassVar[tuple[Confounder, ...]] = (
        Confounder(
            "lagging_law",
            "at a nearly constant acceleration an older speed and a lower speed are the same",
            "runs whose speed changes quickly: chirp and steps",
        ),
    )

    def latency(self, latency_s: FloatArray, k: Kinematics, rng: np.random.Generator) -> FloatArray:
        return latency_s + self.value * k.tangential_mm_s2
