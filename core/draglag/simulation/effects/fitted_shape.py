"""An effect in the shape found by a fit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from draglag.simulation.effects.base import Effect, Parameter


@dataclass(frozen=True)
class FittedShape(Effect):
    """Base of fitted shapes. ``value``: amplitude, mm (a filter: s).

    theta: fitted setting; sizes: of the shape's parts; about: mean square of the panel coordinate (−1 … +1), where
    subtracted from a polynomial's.
    """

    id: ClassVar[str] = "fitted_shape"
    meaning: ClassVar[str] = "A displacement or latency in the shape that a fit found."
    parameters: ClassVar[tuple[Parameter, ...]] = ()

    theta: tuple[float, ...] = ()
    sizes: tuple[float, ...] = ()
    about: float = 0.0

    def __post_init__(self) -> None:
        """A fitted shape has no bounds of its own."""

    def numbers(self) -> dict[str, float]:
        return {"amplitude_mm": float(self.value)}
