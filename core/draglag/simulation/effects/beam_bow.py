"""The beam is curved."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Effect
from draglag.simulation.effects.parameter import Parameter
from draglag.simulation.kinematics import Kinematics
from draglag.simulation.residual import LineGains, Signature, View, column


@dataclass(frozen=True)
class BeamBow(Effect):
    id: ClassVar[str] = "beam_bow"
    meaning: ClassVar[str] = (
        "The beam is curved: in the middle of the panel it lies lower by this much than the line through its places "
        "at the panel's left and right edges."
    )
    follows: ClassVar[str] = "x"
    where: ClassVar[str] = "along the beam, most in the middle"
    separated_by: ClassVar[str] = "a second beam height: a bent panel bends there too, a curved beam moves along"
    undone_in: ClassVar[str] = "laser"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("bow_mm", "mm", -3.0, 3.0, 0.3),)

    def distance(self, distance_mm: FloatArray, k: Kinematics) -> FloatArray:
        u = 2 * k.motion.x_mm / k.width_mm - 1
        return distance_mm - self.value * (1 - u**2)

    @classmethod
    def signatures(cls, view: View, gains: LineGains | None = None) -> list[Signature]:
        # Light travels straight: only a line that is not one beam, or was read wrong, is bowed.
        return [Signature(offset=column(1 - view.panel_x**2), share=0.5)]
