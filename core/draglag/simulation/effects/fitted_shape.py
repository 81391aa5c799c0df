"""An effect in the shape found by a fit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from draglag.simulation.effects.base import Effect
from draglag.simulation.effects.parameter import Parameter


@dataclass(frozen=True)
class FittedShape(Effect):
    """Base of fitted shapes. value: amplitude, mm (a filter: s).

    sizes: of the shape's parts. about: mean panel coordinate (−1 … +1), subtracted from a polynomial's square.
    """

    id: ClassVar[str] = "fitted_shape"
    meaning: ClassVar[str] = "A displacement or latency in the shape that a fit found."
    parameters: ClassVar[tuple[Parameter, ...]] = ()

    theta: tuple[float, ...] = ()
    sizes: tuple[float, ...] = ()
    about: float = 0.0

    def __post_init__(self) -> None:
        """No bounds."""

    def numbers(self) -> dict[str, float]:
        return {"amplitude_mm": float(self.value)}
