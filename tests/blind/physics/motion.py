"""What a hand does with the stylus, whichever hand it is."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Motion:
    """The tip through time, arrays (n,): host time, position, velocity, drag speed, acceleration along the motion.

    Velocity, speed and acceleration are those of the intended movement, without the tremor.
    """

    t_s: np.ndarray
    x_mm: np.ndarray
    y_mm: np.ndarray
    vx_mm_s: np.ndarray
    vy_mm_s: np.ndarray
    speed_mm_s: np.ndarray
    along_mm_s2: np.ndarray
    step_hz: float
