"""The shadow changes along the beam."""

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
class BeamWedge(Effect):
    id: ClassVar[str] = "beam_wedge"
    meaning: ClassVar[str] = (
        "The apparent diameter of the stylus changes by this much from the left edge of the panel to "
        "the right, as in a beam that spreads."
    )
    follows: ClassVar[str] = "x"
    where: ClassVar[str] = "growing along the beam"
    undone_in: ClassVar[str] = "laser"
    needs: ClassVar[str] = "width"
    identifiable_with: ClassVar[str] = "circles that travel across the whole width show it"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("across_mm", "mm", -5.0, 5.0, 1.0, title="across the panel"),
    )

    def diameter(self, diameter_mm: FloatArray, k: Kinematics) -> FloatArray:
        return np.maximum(diameter_mm + self.value * (k.motion.x_mm / k.width_mm - 0.5), 0.0)

    @classmethod
    def signatures(cls, view: View, gains: LineGains | None = None) -> list[Signature]:
        return [Signature(offset=column(0.25 * view.side * view.panel_x))]
