"""How late single reports arrive: polled buses and busy hosts hold some back longer than others.

A digitiser scans evenly; a bus that is polled every millisecond, or every eight, and the host's scheduling put off each
report by an amount of its own. The trace shows the stylus where it was by that much earlier, so it belongs to the
latency of the edges it falls on, and the mean over few edges keeps some of it. Stamps tell it up to a constant: how far
each lies from an even rhythm. But where the scans themselves are uneven the stamps are right as they are; the positions
tell which: a late report lags behind the path by speed times lateness. So each stamp is set back by the share of its
lateness that the positions confirm, which rids the path of its noise, and the edges get back what they met.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from draglag.events import BATCHED, sample_interval_s
from draglag.latency.estimate import Prepared
from draglag.latency.path import LONGEST_FILL, Path, events_of
from draglag.recording import FloatArray, TouchTrace

FEWEST = 40  # events in a stretch: fewer do not show a rhythm
MOST = 0.75  # of the interval: reports later than that were counted wrongly
LEAST_S = 1e-6  # of lateness: what a stamp of 1 us cannot show is none


@dataclass(frozen=True)
class Arrival:
    """Lateness of events at t_s (n,), whose stamps are set back already: late_s (n,), of mean 0, and what of it stamps
    do not show, a standard deviation, s."""

    t_s: FloatArray
    late_s: FloatArray
    unseen_s: float

    def at_edges(self, at_s: FloatArray) -> tuple[float, float, float]:
        """Mean lateness of the trace at times (m,), its standard error, and how much it scatters by chance, s."""
        if not self.late_s.any():
            return 0.0, 0.0, 0.0
        k = np.clip(np.searchsorted(self.t_s, at_s, side="right") - 1, 0, self.t_s.size - 2)
        after = np.clip((at_s - self.t_s[k]) / np.maximum(self.t_s[k + 1] - self.t_s[k], 1e-9), 0.0, 1.0)
        share = np.bincount(k, 1 - after, self.t_s.size) + np.bincount(k + 1, after, self.t_s.size)
        share /= at_s.size
        alone = float(np.sqrt(share @ share))
        return float(share @ self.late_s), self.unseen_s * alone, float(self.late_s.std()) * alone


def lateness_s(t_s: FloatArray) -> FloatArray:
    """By how much each of the rising stamps (n,) lies behind an even rhythm, of mean 0 over each stretch without gaps;
    0 where there is no rhythm to tell from."""
    late_s = np.zeros(t_s.size)
    if t_s.size < FEWEST:
        return late_s
    slot = events_of(t_s, np.zeros((t_s.size, 2))).slot
    starts = np.flatnonzero(np.append(True, np.diff(slot) > LONGEST_FILL))
    for first, end in zip(starts, np.append(starts[1:], t_s.size), strict=True):
        if end - first < FEWEST:
            continue
        piece_s, n = t_s[first:end] - t_s[first], slot[first:end] - slot[first]
        n = n - n.mean()
        off_s = piece_s - piece_s.mean() - n * float(n @ piece_s) / float(n @ n)
        if off_s.std() < MOST * sample_interval_s(t_s):
            late_s[first:end] = off_s
    return late_s


def set_back(ready: Prepared, path: Path) -> tuple[Prepared, Arrival]:
    """The run with each stamp set back by its lateness, as far as the positions confirm it, and that lateness.

    Args:
        path: of the run as it is.
    """
    touch = ready.touch
    came_s = _came_s(ready)
    every_s = lateness_s(came_s)
    none = Arrival(came_s, np.zeros(came_s.size), 0.0)
    if every_s.std() < LEAST_S:
        return ready, none
    late_s = every_s[np.searchsorted(came_s, touch.t_s, side="right") - 1]
    place_mm, v_mm_s = path.with_velocity(touch.t_s)
    shown_mm = v_mm_s * late_s[:, None]
    shown_mm = shown_mm - path.like(shown_mm).at(touch.t_s)  # the path follows what is slow
    share = float(np.vdot(shown_mm, place_mm - ready.xy_mm) / max(float(np.vdot(shown_mm, shown_mm)), 1e-12))
    share = min(max(share, 0.0), 1.0)
    t_s = touch.t_s - share * late_s
    if share == 0.0 or (np.diff(t_s) <= 0).any():
        return ready, none
    again = TouchTrace(t_s, touch.x_mm, touch.y_mm, touch.contact_id, gaps_s=touch.gaps_s)
    # Where stamps scatter by what is lateness and by what is not, lateness is known by this much.
    unseen_s = float(every_s.std() * np.sqrt(share * (1 - share)))
    return replace(ready, touch=again), Arrival(came_s - share * every_s, share * every_s, unseen_s)


def _came_s(ready: Prepared) -> FloatArray:
    """Stamps of all that came: two reports of one poll share theirs, and still are two. Of batches, the last ones."""
    came = ready.run.touch
    came_s = np.sort(came.t_s[np.isfinite(came.t_s) & np.isfinite(came.x_mm) & np.isfinite(came.y_mm)])
    return came_s if ready.touch.t_s.size > (1 - BATCHED) * came_s.size else ready.touch.t_s
