"""Position errors repeat with the electrodes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Effect, Parameter
from draglag.simulation.kinematics import Kinematics


@dataclass(frozen=True)
class PitchRipple(Effect):
    """Position errors repeat with the electrodes."""

    id: ClassVar[str] = "pitch_ripple"
    meaning: ClassVar[str] = (
        "The position error is periodic in the electrode pitch: the error in each axis is a sine of "
        "the place along the other, as diamond electrodes make it."
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("amplitude_mm", "mm", -2.0, 2.0, 0.3),
        Parameter("pitch_mm", "mm", 1.0, 30.0, 5.0),
    )

    pitch_mm: float = 5.0

    def position(self, x_mm: FloatArray, y_mm: FloatArray, k: Kinematics) -> tuple[FloatArray, FloatArray]:
        wave = 2 * np.pi / self.pitch_mm
        x = x_mm + self.value * np.sin(wave * k.motion.y_mm)
        return x, y_mm + self.value * np.sin(wave * k.motion.x_mm)
