"""A fitted bend of the panel's coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.fitted_shape import FittedShape
from draglag.simulation.kinematics import Kinematics


@dataclass(frozen=True)
class FittedBend(FittedShape):
    """sizes, mm: of sine and cosine, or of powers from the square on."""

    def position(self, x_mm: FloatArray, y_mm: FloatArray, k: Kinematics) -> tuple[FloatArray, FloatArray]:
        u = 2 * k.motion.x_mm / k.width_mm - 1
        if self.theta and self.theta[0] > 0:
            shape = [np.sin(self.theta[0] * np.pi * u), np.cos(self.theta[0] * np.pi * u)]
        else:
            shape = [u**k for k in range(2, 2 + len(self.sizes))]
            shape[0] = shape[0] - self.about
        for size, part in zip(self.sizes, shape, strict=True):
            y_mm = y_mm + size * part
        return x_mm, y_mm
