"""What a hand does with the stylus, whichever hand it is."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import oaconvolve

WINDOW_REACHES = 3.0  # standard deviations of a tracker's window that it weighs


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


def tracked(speed_mm_s: np.ndarray, window_s: float, step_hz: float) -> np.ndarray:
    """The speed that a tracker shows, (n,): averaged over a Gaussian window with this standard deviation.

    By products of spectra: a window of hundreds of steps takes ten times as long summed step by step.
    """
    reach = round(WINDOW_REACHES * window_s * step_hz)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / (window_s * step_hz)) ** 2)
    mirrored = np.pad(speed_mm_s, reach, mode="symmetric")
    return np.asarray(oaconvolve(mirrored, weights / weights.sum(), mode="valid"))
