"""A trace freed of a 1 euro filter."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from scipy.sparse import csr_matrix, diags

from draglag.recording import FloatArray
from draglag.simulation.effects.in_fits import UndoneTrace
from draglag.simulation.effects.speed_adaptive_filter.filtering import (
    Setting,
    first_of_contact,
    gains_of_raw,
    unfiltered,
)

if TYPE_CHECKING:
    from draglag.gap.traces.run_data import RunData

DIFFERENCE = np.array([1.0, -5.0, 10.0, -10.0, 5.0, -1.0])
"""Fifth difference of events in a row: next to nothing of a hand is left in it, and most of the noise."""
FAR = 9.0  # times the median size of a difference: a stall or a jump is no noise


@dataclass(frozen=True)
class Unfiltered:
    """The raw positions behind a filter's."""

    setting: Setting

    place: ClassVar[int] = -1
    of_events: ClassVar[bool] = True

    def undo(self, trace: UndoneTrace, shown: RunData, first_s: float) -> UndoneTrace:
        """Noise from before the filter is white again; what was added behind it, as rounding, is correlated now."""
        first = first_of_contact(trace.t_s)
        xy_mm = unfiltered(trace.t_s, trace.xy_mm, self.setting, first)
        amplified = 1 / gains_of_raw(trace.t_s, xy_mm, self.setting, first)
        usual = float(np.median(amplified[~first]))
        noise_mm, behind = _noise_mm(xy_mm[:, 1], usual)
        if not behind:
            return replace(trace, xy_mm=xy_mm, noise_mm=noise_mm, spread=None)
        spread = csr_matrix(diags([amplified, (1 - amplified)[1:]], [0, -1]))
        covariance_mm2 = noise_mm**2 * (usual**2 + (usual - 1) ** 2), -(noise_mm**2) * usual * (usual - 1)
        return replace(trace, xy_mm=xy_mm, noise_mm=noise_mm, spread=spread, covariance_mm2=covariance_mm2)


def _noise_mm(raw_mm: FloatArray, amplified: float) -> tuple[float, bool]:
    """Standard deviation of the noise, mm, and whether it was added behind the filter.

    Behind the inverse, noise from before the filter is white and that from behind it a first-order moving average,
    amplified: the correlation of neighbouring fifth differences lies nearer to that of one of them.
    """
    shown = np.convolve(DIFFERENCE, DIFFERENCE[::-1])
    at = DIFFERENCE.size - 1  # of lag 0
    apart = np.diff(raw_mm, n=at)
    apart = apart[np.abs(apart) < FAR * np.median(np.abs(apart))]
    variance, next_ = np.mean(apart**2), np.mean(apart[1:] * apart[:-1])
    own, neighbour = amplified**2 + (amplified - 1) ** 2, -amplified * (amplified - 1)
    white = shown[at : at + 2]
    moving = own * white + neighbour * (shown[at - 1 : at + 1] + shown[at + 1 : at + 3])
    behind = abs(next_ / variance - moving[1] / moving[0]) < abs(next_ / variance - white[1] / white[0])
    return float(np.sqrt(variance / (moving if behind else white)[0])), bool(behind)
