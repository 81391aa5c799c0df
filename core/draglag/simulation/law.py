"""Latency law: Eq. 5 of the paper without its redundant a3 and a6."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

USUAL_LATENCY_S = 0.05  # by which a law's speed delay is counted from the moment of the report


@dataclass(frozen=True)
class LatencyLaw:
    """L(v) = a1·exp(−a2·v) + a4·exp(−a5·v) + a7 (Table 2)."""

    a1_ms: float
    a2_s_per_mm: float
    a4_ms: float
    a5_s_per_mm: float
    a7_ms: float

    def latency_s(self, speed_mm_s: ArrayLike) -> NDArray[np.float64]:
        """Latency at each speed, same shape."""
        v = np.asarray(speed_mm_s, float)
        fast = self.a1_ms * np.exp(-self.a2_s_per_mm * v)
        slow = self.a4_ms * np.exp(-self.a5_s_per_mm * v)
        return np.asarray((fast + slow + self.a7_ms) / 1000)
