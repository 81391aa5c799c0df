"""Laser edges fit for estimation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from draglag.recording import FloatArray, LaserTrace


@dataclass(frozen=True)
class Edges:
    """Edges at t_s (m,); falling: light→dark; n_rejected: edges no stylus made."""

    t_s: FloatArray
    falling: np.ndarray
    n_rejected: int = 0

    def take(self, keep: np.ndarray) -> Edges:
        return Edges(self.t_s[keep], self.falling[keep], self.n_rejected + int(np.count_nonzero(~keep)))


def clean_edges(laser: LaserTrace, stylus_diameter_mm: float, fastest_mm_s: float) -> Edges:
    """Edges of a run without bounces and glitches.

    Of transitions closer than 0.3 · diameter / fastest speed, an odd number is one edge, an even number none.
    """
    good = np.isfinite(laser.t_s)
    order = np.argsort(laser.t_s[good], kind="stable")
    t_s, light = laser.t_s[good][order], laser.light[good][order]
    if t_s.size == 0:
        return Edges(t_s, np.empty(0, bool))
    # Repeats of one level carry no transition.
    changed = np.append(True, light[1:] != light[:-1])
    n_repeats = int(np.count_nonzero(~changed))
    t_s, light = t_s[changed], light[changed]
    closest_s = 0.3 * stylus_diameter_mm / max(fastest_mm_s, 1.0)
    starts = np.append(True, np.diff(t_s) > closest_s)
    group = np.cumsum(starts) - 1
    size = np.bincount(group)
    keep = starts & (size[group] % 2 == 1)
    return Edges(t_s[keep], light[keep] == 0, n_repeats + int(np.count_nonzero(~keep)))
