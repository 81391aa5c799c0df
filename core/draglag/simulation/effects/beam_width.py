"""The shadow is wider or narrower than the stylus."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Effect
from draglag.simulation.effects.parameter import Parameter
from draglag.simulation.kinematics import Kinematics
from draglag.simulation.residual import LineGains, Signature, View, column


@dataclass(frozen=True)
class BeamWidth(Effect):
    id: ClassVar[str] = "beam_width"
    meaning: ClassVar[str] = "The apparent diameter of the stylus is off by a constant."
    follows: ClassVar[str] = "kind_of_edge"
    where: ClassVar[str] = "every edge, outwards or inwards"
    separated_by: ClassVar[str] = (
        "measure the stylus, as a wrong diameter looks the same; "
        "a second beam position separates a wider shadow from a wrong scale"
    )
    undone_in: ClassVar[str] = "laser"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("extra_mm", "mm", -5.0, 5.0, -1.0),)

    def diameter(self, diameter_mm: FloatArray, k: Kinematics) -> FloatArray:
        return np.maximum(diameter_mm + self.value, 0.0)

    @classmethod
    def signatures(cls, view: View, gains: LineGains | None = None) -> list[Signature]:
        # A wrong scale looks alike: every edge lies half a diameter from the beam.
        return [Signature(offset=column(0.5 * view.side))]
