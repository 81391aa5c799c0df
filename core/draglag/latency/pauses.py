"""Edges in a pause of the hand, with longer latencies of their own."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from draglag.latency.estimate import Prepared
from draglag.latency.track import Track
from draglag.path.events import in_contact, median
from draglag.recording import FloatArray

SLOW = 0.6  # of the run's usual speed: slower is a pause
MOST = 0.1  # of the edges: a run with more is one of uneven speed, not one with pauses
REACH_S = (-0.05, 0.2)  # from the latency of the others: where the trace is searched
AROUND = 3  # events on either side: the velocity at a crossing
SLOWEST_MM_S = 10.0  # below it, noise alone crosses a line several times


@dataclass(frozen=True)
class Pauses:
    t_s: FloatArray
    latency_s: FloatArray
    se_s: FloatArray
    speed_mm_s: FloatArray

    def mixed(self, mean_s: float, se_s: float, n: int) -> tuple[float, float]:
        """Mean latency and standard error with n other edges."""
        share = n / (n + self.t_s.size)
        own_s = float(np.sqrt(np.sum(self.se_s**2))) / (n + self.t_s.size)
        pauses_s = float(self.latency_s.mean()) if self.t_s.size else 0.0
        return share * mean_s + (1 - share) * pauses_s, float(np.hypot(share * se_s, own_s))


NONE = Pauses(*(np.empty(0),) * 4)


def without_pauses(ready: Prepared, track: Track, latency_s: float, line: FloatArray) -> tuple[Prepared, Pauses]:
    """The run without edges in pauses, and those.

    ``latency_s``: of the others; ``line``: slope, middle and half width (mm) of their lines.
    """
    t_s, touch = ready.edges.t_s, ready.touch
    inside = in_contact(touch.t_s, t_s + latency_s, track.losses_s)
    v_mm_s = track.path.at(t_s + latency_s, 1)
    speed = np.hypot(v_mm_s[:, 0], v_mm_s[:, 1])
    slow = inside & (speed < SLOW * median(speed[inside])) if inside.any() else inside
    if not slow.any() or np.count_nonzero(slow) > MOST * t_s.size:
        return ready, NONE
    slope, middle, half = line
    off_mm = touch.y_mm - slope * touch.x_mm - middle
    noise_mm = 1.4826 * median(np.abs(touch.y_mm - track.at(touch.t_s)[:, 1]))
    found = []
    # A trace shows all edges in their order: one in a pause after the last before it that is in none, and before the
    # next.
    others_s = np.concatenate([[-np.inf], t_s[~slow], [np.inf]])
    for k in np.flatnonzero(slow):
        after = int(np.searchsorted(others_s, t_s[k]))
        between_s = np.clip(others_s[after - 1 : after + 1] - t_s[k], *REACH_S)
        crossing = _shown(touch.t_s, off_mm, half, t_s[k], bool(ready.edges.falling[k]), latency_s, between_s)
        if crossing is not None:
            own_s, across = crossing
            found.append((k, own_s, noise_mm / max(across, SLOWEST_MM_S), speed[k]))
    if not found:
        return ready, NONE
    which, own, se, at = (np.array(column) for column in zip(*found, strict=True))
    # A slow edge that the trace does not show has an unknown latency: it is none of the others, but rejected.
    n_rejected = ready.edges.n_rejected + int(np.count_nonzero(slow)) - which.size
    others = replace(ready.edges.take(~slow), n_rejected=n_rejected)
    return replace(ready, edges=others), Pauses(t_s[which], own, se, at)


def _shown(
    t_s: FloatArray,
    off_mm: FloatArray,
    half_mm: float,
    edge_s: float,
    falling: bool,
    latency_s: float,
    between_s: FloatArray,
) -> tuple[float, float] | None:
    """Time until the trace shows an edge, and its speed across the beam there. between_s: from the others' latency.

    Each line counts one way only: the stylus enters by its first rim and leaves by its last.
    """
    first, end = np.searchsorted(t_s, edge_s + latency_s + between_s)
    best: tuple[float, float] | None = None
    for up in (True, False):
        side = -1.0 if up == falling else 1.0
        z = off_mm[first:end] - side * half_mm
        if not up:
            z = -z
        for j in np.flatnonzero((z[:-1] < 0) & (z[1:] >= 0)):
            k = first + int(j)
            at_s = t_s[k] + (t_s[k + 1] - t_s[k]) * z[j] / (z[j] - z[j + 1])
            low, high = max(k + 1 - AROUND, 0), min(k + AROUND, t_s.size - 1)
            across = abs(off_mm[high] - off_mm[low]) / (t_s[high] - t_s[low])
            if best is None or abs(at_s - edge_s - latency_s) < abs(best[0] - latency_s):
                best = float(at_s - edge_s), float(across)
    return best
