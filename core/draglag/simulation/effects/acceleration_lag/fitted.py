"""A fitted acceleration lag."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.fitted_shape import FittedShape
from draglag.simulation.kinematics import Kinematics

REACH = 5.0  # standard deviations that the window reaches to either side. Derived: e⁻¹²


@dataclass(frozen=True)
class SmoothedLag(FittedShape):
    """value: lag, s per mm/s². theta: size assumed in the trace, and the panel's window, s."""

    def numbers(self) -> dict[str, float]:
        return {"lag_s_per_mm_s2": float(self.value)}

    def per_acceleration_s3_mm(self) -> float:
        return max(float(self.value), 0.0)

    def latency(self, latency_s: FloatArray, k: Kinematics, rng: np.random.Generator) -> FloatArray:
        return latency_s + self.value * in_a_window(k.tangential_mm_s2, self.theta[1] / k.step_s)


def in_a_window(values: FloatArray, width: float) -> FloatArray:
    """Values (n,) smoothed by a Gaussian, mirrored at their ends. width: its standard deviation, samples."""
    edge = min(round(REACH * width), values.size - 1)
    padded = np.pad(values, edge, mode="reflect")
    omega = 2 * np.pi * np.fft.rfftfreq(padded.size)
    smooth = np.fft.irfft(np.fft.rfft(padded) * np.exp(-0.5 * (omega * width) ** 2), padded.size)
    return np.asarray(smooth[edge : edge + values.size])
