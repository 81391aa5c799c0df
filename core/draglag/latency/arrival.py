"""Lateness of touch events by a polled bus or a busy host."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from draglag.latency.estimate import Prepared
from draglag.latency.path import Path
from draglag.latency.spectrum import LONGEST_FILL, events_of
from draglag.latency.track import Smoothed, smoothed_of
from draglag.path.events import BATCHED, median
from draglag.recording import FloatArray, IntArray, TouchTrace

FEWEST = 200  # events in a stretch: fewer do not show a rhythm
MANY = 50  # intervals
SLIP = 0.5  # of the interval: a lasting step this large is a report that never came
AROUND = 40  # events on either side of such a step
REFINED, SETTLED = 4, 0.02  # a path that was blurred by late stamps shows them in part
LEAST_S = 1e-6  # of lateness: what a stamp of 1 us cannot show is none


@dataclass(frozen=True)
class Arrival:
    """Lateness late_s (n,), mean 0, already taken out of t_s (n,); unobserved_s: standard deviation of the rest."""

    t_s: FloatArray
    late_s: FloatArray
    unobserved_s: float

    def at_edges(self, at_s: FloatArray) -> tuple[float, float, float]:
        """Mean lateness at times (m,), its standard error, its scatter by chance."""
        if not self.late_s.any():
            return 0.0, 0.0, 0.0
        k = np.clip(np.searchsorted(self.t_s, at_s, side="right") - 1, 0, self.t_s.size - 2)
        after = np.clip((at_s - self.t_s[k]) / np.maximum(self.t_s[k + 1] - self.t_s[k], 1e-9), 0.0, 1.0)
        parts = (np.bincount(at, weight, self.t_s.size) for at, weight in ((k, 1 - after), (k + 1, after)))
        share: FloatArray = np.asarray(sum(parts), np.float64) / at_s.size
        alone = float(np.sqrt(share @ share))
        return float(share @ self.late_s), self.unobserved_s * alone, float(self.late_s.std()) * alone


def lateness_s(t_s: FloatArray) -> FloatArray:
    """Lateness of rising stamps (n,) on an even rhythm, mean 0 per gapless stretch."""
    late_s = np.zeros(t_s.size)
    if t_s.size < FEWEST:
        return late_s
    # Intervals on a coarse poll are one poll or two, whatever the scans': only many together show theirs.
    dt_s = median(t_s[MANY:] - t_s[:-MANY]) / MANY
    slot = events_of(t_s, np.zeros((t_s.size, 2)), dt_s).slot
    cuts = [0, *(1 + np.flatnonzero(np.diff(slot) > LONGEST_FILL)), t_s.size]
    for first, end in pairwise(cuts):
        if end - first >= FEWEST:
            late_s[first:end] = _lateness_of_stretch_s(t_s[first:end], slot[first:end], SLIP * dt_s)
    return late_s


def _lateness_of_stretch_s(t_s: FloatArray, slot: IntArray, slip_s: float) -> FloatArray:
    if t_s.size < FEWEST:
        return np.zeros(t_s.size)
    n = slot - slot.mean()
    off_s = t_s - t_s.mean()
    off_s = off_s - n * float(n @ off_s) / float(n @ n)
    total_s = np.concatenate([[0.0], np.cumsum(off_s)])
    mean_s = (total_s[AROUND:] - total_s[:-AROUND]) / AROUND
    step_s = np.abs(mean_s[AROUND:] - mean_s[:-AROUND])
    at = int(np.argmax(step_s))
    if step_s[at] < slip_s:
        return np.asarray(off_s)
    cut = at + AROUND
    parts = (slice(None, cut), slice(cut, None))
    return np.concatenate([_lateness_of_stretch_s(t_s[part], slot[part], slip_s) for part in parts])


def set_back(ready: Prepared) -> tuple[Prepared, Arrival, Smoothed | None]:
    """The run with stamps moved back; the lateness; the path, if none moved.

    Scans may be uneven: only lateness that positions confirm is taken out.
    """
    touch = ready.touch
    arrival_s = _arrival_s(ready)
    every_s = lateness_s(arrival_s)
    none = Arrival(arrival_s, np.zeros(arrival_s.size), 0.0)
    if every_s.std() < LEAST_S:
        return ready, none, None
    late_s = every_s[np.searchsorted(arrival_s, touch.t_s, side="right") - 1]
    share, again, first = 0.0, ready, smoothed_of(ready)
    smoothed = first
    for _ in range(REFINED):
        more = _confirmed(again, late_s, smoothed.path)
        share, before = min(max(share + more, 0.0), 1.0), share
        t_s = touch.t_s - share * late_s
        if share == 0.0 or (np.diff(t_s) <= 0).any():
            return ready, none, first
        again = replace(ready, touch=TouchTrace(t_s, touch.x_mm, touch.y_mm, touch.contact_id, gaps_s=touch.gaps_s))
        if abs(share - before) < SETTLED:
            break
        smoothed = smoothed_of(again)
    # Where stamps scatter by what is lateness and by what is not, lateness is known by this much.
    unobserved_s = float(every_s.std() * np.sqrt(share * (1 - share)))
    return again, Arrival(arrival_s - share * every_s, share * every_s, unobserved_s), None


def _confirmed(ready: Prepared, late_s: FloatArray, path: Path) -> float:
    place_mm, v_mm_s = path.with_velocity(ready.touch.t_s)
    shown_mm = v_mm_s * late_s[:, None]
    shown_mm = shown_mm - path.like(shown_mm).at(ready.touch.t_s)  # the path follows what is slow
    return float(np.vdot(shown_mm, place_mm - ready.xy_mm) / max(float(np.vdot(shown_mm, shown_mm)), 1e-12))


def _arrival_s(ready: Prepared) -> FloatArray:
    events = ready.run.touch
    arrival_s = np.sort(events.t_s[np.isfinite(events.t_s) & np.isfinite(events.x_mm) & np.isfinite(events.y_mm)])
    return arrival_s if ready.touch.t_s.size > (1 - BATCHED) * arrival_s.size else ready.touch.t_s
