"""Clocks of simulated devices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from draglag.recording import ClockBounds, FloatArray

# One exchange with a device: round trips of 100–400 us, as over USB or a fieldbus (fact: 0.1 ms typical).
_ROUND_TRIP_S = (1e-4, 4e-4)


@dataclass(frozen=True)
class DeviceClock:
    """device = offset + (1 + drift) · host; resolution 0: unrounded."""

    offset_s: float
    drift: float
    resolution_s: float = 0.0

    def stamp(self, host_s: FloatArray) -> FloatArray:
        """Device times, (n,)."""
        device = self.offset_s + (1 + self.drift) * host_s
        if self.resolution_s > 0:
            device = np.round(device / self.resolution_s) * self.resolution_s
        return device

    def bounds(self, stream: str, host_s: FloatArray, rng: np.random.Generator) -> ClockBounds:
        """One comparison at each host time."""
        trip = rng.uniform(*_ROUND_TRIP_S, host_s.shape)
        before = host_s - trip * rng.uniform(0.2, 0.8, host_s.shape)
        epoch = np.zeros(len(host_s), np.int64)
        # Rounding of the stamp widens what the exchange can promise.
        slack = self.resolution_s
        return ClockBounds(stream, self.stamp(host_s), before - slack, before + trip + slack, epoch)


def random_clock(rng: np.random.Generator, resolution_s: float = 0.0) -> DeviceClock:
    """A clock some hours after power-on, drift within ±15 ppm."""
    return DeviceClock(float(rng.uniform(10, 1e4)), float(rng.uniform(-15e-6, 15e-6)), resolution_s)
