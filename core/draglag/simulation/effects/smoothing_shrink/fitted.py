"""A fitted causal low-pass."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from draglag.path.recursion import exponentially_smoothed
from draglag.recording import FloatArray
from draglag.simulation.effects.fitted_shape import FittedShape
from draglag.simulation.kinematics import Kinematics


@dataclass(frozen=True)
class CausalWindow(FittedShape):
    """value: time constant, s."""

    def law_speed(self, speed_mm_s: FloatArray, k: Kinematics) -> FloatArray:
        """Speed a time constant later."""
        t = k.motion.t_s
        return np.interp(t + self.value, t, speed_mm_s)

    def position(self, x_mm: FloatArray, y_mm: FloatArray, k: Kinematics) -> tuple[FloatArray, FloatArray]:
        return low_passed(x_mm, self.value, k.step_s), low_passed(y_mm, self.value, k.step_s)


def low_passed(position_mm: FloatArray, time_constant_s: float, step_s: float) -> FloatArray:
    """Path (n,) after a causal first-order low-pass, its delay compensated."""
    if time_constant_s <= 0:
        return position_mm
    keep = float(np.exp(-step_s / time_constant_s))
    late = exponentially_smoothed(position_mm, keep)
    delay_s = step_s * keep / (1 - keep)  # of the sampled recursion: half a step less than the time constant
    t = step_s * np.arange(position_mm.size)
    return np.asarray(np.interp(t + delay_s, t, late))
