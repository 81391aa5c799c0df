"""Reported positions are scaled wrongly."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from draglag.recording import FloatArray, Screen
from draglag.simulation.effects.base import Effect
from draglag.simulation.effects.in_fits import Z95, FittedTerm, Parameters
from draglag.simulation.effects.parameter import PER_CENT, Parameter
from draglag.simulation.kinematics import Kinematics


@dataclass(frozen=True)
class ScaleError(Effect):
    id: ClassVar[str] = "scale_error"
    meaning: ClassVar[str] = "Reported positions are stretched about the middle of the panel by this share."
    where: ClassVar[str] = "every edge, outwards or inwards"
    shares_column_of: ClassVar[str] = "beam_width"
    separated_by: ClassVar[str] = (
        "measure the stylus, as a wrong diameter looks the same; "
        "a second beam position separates a wider shadow from a wrong scale"
    )
    undone_in: ClassVar[str] = "touch"
    needs: ClassVar[str] = "other stylus"
    identifiable_with: ClassVar[str] = "a second beam position separates a wider shadow from a wrong scale"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("share", "1", -0.2, 0.2, 0.02, read_as=PER_CENT),)

    def position(self, x_mm: FloatArray, y_mm: FloatArray, k: Kinematics) -> tuple[FloatArray, FloatArray]:
        x = x_mm + self.value * (k.motion.x_mm - k.width_mm / 2)
        return x, y_mm + self.value * (k.motion.y_mm - k.height_mm / 2)

    def true_intercept_mm(self, intercept_mm: float, slope: float, screen: Screen) -> float:
        middle = 0.5 * (screen.height_mm - slope * screen.width_mm)
        return (intercept_mm + self.value * middle) / (1 + self.value)

    @classmethod
    def parameters_in(cls, found: FittedTerm) -> Parameters:
        """Share by which the disc reads too large."""
        diameter = found.fit.geometry.diameter_mm
        value, reach = found.sizes[0] / diameter, Z95 * found.se[0] / diameter
        return {"share": (float(value), (float(value - reach), float(value + reach)))}
