"""Tap latency from the WALT (the paper, Section III.B)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from draglag.recording import FloatArray, Taps
from draglag.shown import brief

LONGEST_S = 0.2  # the public tool's limit: later events belong to something else


@dataclass(frozen=True)
class TapSummary:
    """Latency of one kind of tap event.

    ``ci95_s``: of the median by order statistics, each half width h widened to √(h² + ``clock_uncertainty_s``²).
    """

    n: int
    n_rejected: int
    median_s: float
    iqr_s: tuple[float, float]
    ci95_s: tuple[float, float]
    latency_s: FloatArray
    clock_uncertainty_s: float = 0.0

    @property
    def median_se_s(self) -> float:
        """Standard error of the median, from its interval."""
        return (self.ci95_s[1] - self.ci95_s[0]) / (2 * 1.96)

    def to_dict(self) -> dict[str, object]:
        return {
            "n": self.n,
            "n_rejected": self.n_rejected,
            "median_ms": 1e3 * self.median_s,
            "median_ci95_ms": [1e3 * v for v in self.ci95_s],
            "iqr_ms": [1e3 * v for v in self.iqr_s],
            "clock_uncertainty_ms": 1e3 * self.clock_uncertainty_s,
        }

    __repr__ = brief


def summarise_taps(taps: Taps | None, clock_uncertainty_s: float = 0.0) -> dict[str, TapSummary]:
    """Summaries of usable "touch" and "release" events."""
    from scipy.special import bdtr

    if taps is None:
        return {}
    out = {}
    for name, down in (("touch", 1), ("release", 0)):
        latency_s = (taps.registered_s - taps.physical_s)[taps.down == down]
        good = np.sort(latency_s[np.isfinite(latency_s) & (latency_s >= 0) & (latency_s <= LONGEST_S)])
        if not good.size:
            continue
        # The k-th order statistics whose ranks enclose the median with 95 % probability.
        k = int(np.searchsorted(bdtr(np.arange(good.size + 1.0), good.size, 0.5), 0.025))
        interval = (float(good[max(k - 1, 0)]), float(good[min(good.size - k, good.size - 1)]))
        median = float(np.median(good))
        low, high = (float(np.hypot(end - median, clock_uncertainty_s)) for end in interval)
        quartiles = np.percentile(good, [25, 75])
        out[name] = TapSummary(
            int(good.size),
            int(latency_s.size - good.size) + taps.rejected.get(name, 0),
            median,
            (float(quartiles[0]), float(quartiles[1])),
            (median - low, median + high),
            good,
            clock_uncertainty_s,
        )
    return out
