"""Difference of two latency curves."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from draglag.curve.fit import CurveFit
from draglag.recording import FloatArray
from draglag.shown import chance, table_html

SPEEDS_MM_S = (50.0, 75.0, 100.0, 150.0, 200.0, 300.0, 400.0, 600.0, 800.0, 1000.0)


@dataclass(frozen=True)
class CurveDifference:
    """Second curve minus first, (k,), with a pointwise 95 % band.

    ``p_value``: of the greatest standardised difference (Bonferroni).
    """

    speed_mm_s: FloatArray
    difference_s: FloatArray
    low_s: FloatArray
    high_s: FloatArray
    p_value: float

    def to_dict(self) -> dict[str, object]:
        return {
            "p_value": self.p_value,
            "differ": self.p_value < 0.05,
            "rms_ms": 1e3 * float(np.sqrt(np.mean(self.difference_s**2))),
            "at": [
                {
                    "speed_mm_s": float(v),
                    "difference_ms": 1e3 * float(d),
                    "difference_ci95_ms": [1e3 * float(a), 1e3 * float(b)],
                }
                for v, d, a, b in zip(self.speed_mm_s, self.difference_s, self.low_s, self.high_s, strict=True)
            ],
        }

    def __repr__(self) -> str:
        low, high = self.speed_mm_s[0], self.speed_mm_s[-1]
        rms_ms = 1e3 * float(np.sqrt(np.mean(self.difference_s**2)))
        return f"CurveDifference(RMS {rms_ms:.2f} ms from {low:.0f} to {high:.0f} mm/s, p = {self.p_value:.2g})"

    def _repr_html_(self) -> str:
        rows = zip(
            self.speed_mm_s, 1e3 * self.difference_s, 1e3 * self.low_s, 1e3 * self.high_s, strict=True
        )  # fmt: skip
        head = ["speed_mm_s", "difference_ms", "low_ms", "high_ms"]
        return table_html(f"Difference of two curves, 95 % band, {chance(self.p_value)}", head, rows)

    def plot(self, ax: Any = None) -> Any:
        """Matplotlib axes with difference and band."""
        from draglag.drawing.results import draw_difference, own_axes

        axes = own_axes(ax)
        draw_difference(axes, self)
        return axes


def curve_difference(
    first: CurveFit, second: CurveFit, speeds_mm_s: FloatArray | None = None
) -> CurveDifference | None:
    """Difference over the speeds covered by both curves; None if there are none."""
    low = max(first.speed_range_mm_s[0], second.speed_range_mm_s[0])
    high = min(first.speed_range_mm_s[1], second.speed_range_mm_s[1])
    if low >= high:
        return None
    if speeds_mm_s is None:
        inner = [v for v in SPEEDS_MM_S if low < v < high]
        speeds_mm_s = np.array([low, *inner, high])
    speed = speeds_mm_s[(speeds_mm_s >= low) & (speeds_mm_s <= high)]
    difference = second.predict_s(speed) - first.predict_s(speed)
    halves = [0.5 * (band[1] - band[0]) for band in (first.band_s(speed), second.band_s(speed))]
    half = np.maximum(np.hypot(*halves), 1e-9)
    largest = float(np.max(np.abs(difference) / half)) * 1.96
    p_value = min(1.0, math.erfc(largest / np.sqrt(2)) * speed.size)
    return CurveDifference(speed, difference, difference - half, difference + half, p_value)
