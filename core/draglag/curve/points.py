"""What a curve is fitted to."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from draglag.recording import FloatArray
from draglag.shown import brief


@dataclass(frozen=True)
class CurvePoints:
    """Latency of each run, (n,) each.

    ``speed_se_mm_s``: standard error of the speed; ``speed_sd_mm_s``: its spread over edges.
    """

    speed_mm_s: FloatArray
    latency_s: FloatArray
    se_s: FloatArray
    speed_se_mm_s: FloatArray | None = None
    speed_sd_mm_s: FloatArray | None = None

    def take(self, keep: np.ndarray) -> CurvePoints:
        speed_se = None if self.speed_se_mm_s is None else self.speed_se_mm_s[keep]
        speed_sd = None if self.speed_sd_mm_s is None else self.speed_sd_mm_s[keep]
        return CurvePoints(self.speed_mm_s[keep], self.latency_s[keep], self.se_s[keep], speed_se, speed_sd)

    def with_speed_error(self, slope_s_per_mm_s: FloatArray) -> CurvePoints:
        """The points with the error of their speeds added to ``se_s``."""
        if self.speed_se_mm_s is None:
            return self
        return replace(self, se_s=np.hypot(self.se_s, slope_s_per_mm_s * self.speed_se_mm_s))

    @property
    def speeds_mm_s(self) -> tuple[FloatArray, ...]:
        """Speeds (n,) to average L over, exact to third order."""
        if self.speed_sd_mm_s is None:
            return (self.speed_mm_s,)
        reach = np.minimum(self.speed_sd_mm_s, 0.5 * self.speed_mm_s)
        return self.speed_mm_s - reach, self.speed_mm_s + reach

    __repr__ = brief


SAME_SPEED = 1.1  # runs whose speeds are closer than a tenth repeat one speed: hands repeat a target to a few percent


def distinct_speeds(speed_mm_s: FloatArray) -> int:
    """Number of different speeds."""
    count, start = 0, 0.0
    for speed in np.sort(speed_mm_s).tolist():
        if count == 0 or speed > SAME_SPEED * start:
            count, start = count + 1, speed
    return count
