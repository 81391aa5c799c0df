"""Undoing of a second filter's lateness."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from draglag.path.motion import best_half_width_s
from draglag.recording import FloatArray
from draglag.simulation.effects.in_fits import UndoneTrace

if TYPE_CHECKING:
    from draglag.gap.traces.run_data import RunData


@dataclass(frozen=True)
class Lateness:
    """Lateness of touch stamps in stretches from–to of session time."""

    size_s: float
    times_s: tuple[float, ...]

    place: ClassVar[int] = 0
    of_events: ClassVar[bool] = False

    def undo(self, trace: UndoneTrace, shown: RunData, first_s: float) -> UndoneTrace:
        t_s, xy_mm = without_lateness(trace.t_s, trace.xy_mm, self.size_s, first_s + np.array(self.times_s))
        if t_s.size < 2:
            return replace(trace, t_s=t_s, xy_mm=xy_mm)
        # What the skips were is noise no longer.
        noise_mm = best_half_width_s(t_s, xy_mm[:, 1:], shown.edge_t_s + shown.guess_s)[1]
        return replace(trace, t_s=t_s, xy_mm=xy_mm, noise_mm=min(trace.noise_mm, noise_mm))


def without_lateness(
    t_s: FloatArray, xy_mm: FloatArray, size_s: float, times_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Events (n,), (n, 2) without the lateness and without those of standstills. times_s: (2 k,) on the clock of
    ``t_s``."""
    late = np.searchsorted(times_s, t_s - size_s) % 2 == 1
    begins = times_s[::2]
    still = np.searchsorted(begins, t_s) != np.searchsorted(begins, t_s - size_s)
    own_s = t_s - size_s * late
    order = np.flatnonzero(~still)[np.argsort(own_s[~still], kind="stable")]
    keep = np.append(True, np.diff(own_s[order]) > 0)
    return own_s[order[keep]], xy_mm[order[keep]]
