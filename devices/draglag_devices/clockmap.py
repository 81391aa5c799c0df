"""Device stamps → host times while recording."""

from __future__ import annotations

from collections import deque

import numpy as np

from draglag.recording import ClockBounds, FloatArray

# Quartz stays well inside this; it keeps the slope sane while the bounds still span a short time.
_DRIFT_SIGMA = 1e-4


class OnlineClockMap:
    """A line through an epoch's last ``keep`` bounds, weighted by width; prior of the drift 0 ± 100 ppm."""

    def __init__(self, keep: int = 120) -> None:
        self._bounds: deque[tuple[float, float, float]] = deque(maxlen=keep)
        self._epoch: int | None = None
        self._line: tuple[float, float, float] | None = None  # reference device time, offset there, drift

    def add(self, bounds: ClockBounds) -> None:
        """Use two-sided bounds; a new epoch discards earlier ones."""
        for k in range(len(bounds.device_s)):
            epoch = int(bounds.epoch[k]) if len(bounds.epoch) else 0
            if epoch != self._epoch:
                self._bounds.clear()
                self._epoch = epoch
            low, high = float(bounds.host_min_s[k]), float(bounds.host_max_s[k])
            if np.isfinite(low) and np.isfinite(high):
                self._bounds.append((float(bounds.device_s[k]), low, high))
        self._line = None

    @property
    def ready(self) -> bool:
        return bool(self._bounds)

    def to_host(self, device_s: FloatArray) -> FloatArray:
        """Host times, (n,). Raises ValueError before any bounds."""
        if not self._bounds:
            raise ValueError("no bounds between the device's clock and the host's yet")
        if self._line is None:
            self._line = self._fit()
        reference, offset, drift = self._line
        return device_s + offset + drift * (device_s - reference)

    def _fit(self) -> tuple[float, float, float]:
        table = np.array(self._bounds)
        device, middle = table[:, 0], (table[:, 1] + table[:, 2]) / 2
        # The truth is anywhere between the bounds: a uniform error of that width.
        sigma = np.maximum(table[:, 2] - table[:, 1], 1e-7) / np.sqrt(12)
        weight = 1 / sigma**2
        reference = float(np.average(device, weights=weight))
        difference = middle - device
        base = float(np.average(difference, weights=weight))
        span = device - reference
        drift = float(np.sum(weight * span * (difference - base)) / (np.sum(weight * span**2) + 1 / _DRIFT_SIGMA**2))
        return reference, base, drift
