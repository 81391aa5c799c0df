"""The stylus at every millisecond."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

GRID_HZ = 1000.0
"""Positions are linear between grid points: wrong by less than 3 µm on a 50 mm circle at 1000 mm/s."""


@dataclass(frozen=True)
class Motion:
    """Stylus during one run, (n,) on a regular grid; ``t_s`` from the run's start."""

    t_s: FloatArray
    x_mm: FloatArray
    y_mm: FloatArray
    vx_mm_s: FloatArray
    vy_mm_s: FloatArray
    in_contact: NDArray[np.bool_]

    @property
    def speed_mm_s(self) -> FloatArray:
        return np.hypot(self.vx_mm_s, self.vy_mm_s)


@dataclass(frozen=True)
class Kinematics:
    """A motion with session time and the panel's size."""

    motion: Motion
    session_s: FloatArray
    width_mm: float
    height_mm: float

    @property
    def step_s(self) -> float:
        return float(self.motion.t_s[1] - self.motion.t_s[0])

    @cached_property
    def speed_mm_s(self) -> FloatArray:
        return self.motion.speed_mm_s

    @cached_property
    def tangential_mm_s2(self) -> FloatArray:
        """Rate of change of the speed."""
        return np.gradient(self.speed_mm_s, self.step_s)


def motion_of(t_s: FloatArray, x_mm: FloatArray, y_mm: FloatArray, in_contact: NDArray[np.bool_]) -> Motion:
    """Motion with central differences as velocities."""
    return Motion(t_s, x_mm, y_mm, np.gradient(x_mm, t_s), np.gradient(y_mm, t_s), in_contact)


def grid(duration_s: float) -> FloatArray:
    """Times 0 … duration at 1 kHz."""
    return np.arange(round(duration_s * GRID_HZ) + 1) / GRID_HZ
