"""The shadow is wider or narrower than the stylus."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Confounder, Effect, Parameter
from draglag.simulation.kinematics import Kinematics


@dataclass(frozen=True)
class BeamWidth(Effect):
    """The shadow is wider or narrower than the stylus."""

    id: ClassVar[str] = "beam_width"
    meaning: ClassVar[str] = "The apparent diameter of the stylus is off by a constant."
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("extra_mm", "mm", -5.0, 5.0, -1.0),)
    confounded_with: ClassVar[tuple[Confounder, ...]] = (
        Confounder(
            "scale_error",
            "all edges lie within half a diameter of the beam, where a stretch only changes the apparent width",
            "a second beam position, some centimetres away",
        ),
    )

    def diameter(self, diameter_mm: FloatArray, k: Kinematics) -> FloatArray:
        return np.maximum(diameter_mm + self.value, 0.0)
