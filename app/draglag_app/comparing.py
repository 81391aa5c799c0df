"""How two latency curves differ. No Qt."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from draglag.curve import CurveFit
from draglag.recording import FloatArray


@dataclass(frozen=True)
class Difference:
    """Second curve minus first at speeds both were measured at: (k,) each, with a 95 % band."""

    speed_mm_s: FloatArray
    difference_s: FloatArray
    low_s: FloatArray
    high_s: FloatArray


def difference(first: CurveFit, second: CurveFit, count: int = 300) -> Difference | None:
    """The difference over the speeds that both curves cover; None where they share none.

    The half widths of both pointwise bands add in quadrature: the sessions are independent.
    """
    low = max(first.speed_range_mm_s[0], second.speed_range_mm_s[0])
    high = min(first.speed_range_mm_s[1], second.speed_range_mm_s[1])
    if low >= high:
        return None
    speed = np.linspace(low, high, count)
    apart = second.predict_s(speed) - first.predict_s(speed)
    halves = [0.5 * (band[1] - band[0]) for band in (first.band_s(speed), second.band_s(speed))]
    half = np.hypot(*halves)
    return Difference(speed, apart, apart - half, apart + half)
