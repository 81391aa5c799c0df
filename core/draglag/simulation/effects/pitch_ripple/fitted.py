"""A fitted ripple, with free phases."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.fitted_shape import FittedShape
from draglag.simulation.kinematics import Kinematics


@dataclass(frozen=True)
class FittedRipple(FittedShape):
    """sizes, mm: of sin and cos along x, then along y, in y; then the same in x, if known."""

    def position(self, x_mm: FloatArray, y_mm: FloatArray, k: Kinematics) -> tuple[FloatArray, FloatArray]:
        waves = [2 * np.pi * at / self.theta[0] for at in (k.motion.x_mm, k.motion.y_mm)]
        shape = [f(wave) for wave in waves for f in (np.sin, np.cos)]
        x_mm = x_mm + sum((size * part for size, part in zip(self.sizes[4:], shape, strict=False)), 0.0)
        for size, part in zip(self.sizes[:4], shape, strict=False):  # of the columns only, or of the rows too
            y_mm = y_mm + size * part
        return x_mm, y_mm
