"""A filter that comes and goes as touch events show it: its trace stands still when it takes over, and skips as far
ahead when it lets go.

The lateness is one for all runs: in time, whatever their speed. Which switches are likeliest, a tracker tells.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from scipy.ndimage import gaussian_filter1d, median_filter

from draglag.gap.run_data import RunData
from draglag.gap.tracker import FAR, HISTORIES, SWITCH, followed, side_by_side
from draglag.motion import local_fit
from draglag.recording import FloatArray
from draglag.simulation.effects.second_filter_mode import within

QUICKER = 9  # events over which a step is compared with those beside it: a skip takes one or two
SLOWEST_MM_S = 60.0  # slower, a skip of some milliseconds is within the noise
LEAST_SKIP_S, SURE = 0.003, 6.0  # and robust deviations of the run's own steps
OF_AN_INTERVAL = 0.5  # more or less, frames were lost or held back, not the stylus
FEWEST = 12  # skips, and half as many standstills
UNSTEADY_MM2_S3 = np.geomspace(1e3, 1e6, 4)  # power of a hand's random acceleration
LEAST_EACH = 8.0  # log-likelihood for each switch of a run; what a tremor makes up comes to 2 to 5
LEAST_GAIN = 1000.0  # of all runs; other effects come to some 200
DIRECTIONS = np.pi / 4 * np.arange(4)
GRID_S, PANELS_S = 0.005, 0.05  # a panel's own smoothing of a speed, about
TOLD = 0.85  # of both states, that a threshold of the speed's change has to tell apart
ALIKE, MOSTLY = 0.2, 0.6  # of a run's events by place, direction or speed, within which so many of its switches lie


@dataclass(frozen=True)
class Skips:
    """size_s: how much later the events are; times_s: (2 k,) stretches from–to in which they are, of session time as
    the trace shows it without the lateness; gain: log-likelihood of the events that it saves."""

    size_s: float
    times_s: FloatArray
    gain: float

    @property
    def theta(self) -> tuple[float, ...]:
        """As a term of ``second_filter_mode``: what is undone in the traces, kind 3, and its times."""
        return self.size_s, 3.0, *self.times_s.tolist()


@lru_cache(maxsize=1)
def find_skips(all_runs: tuple[RunData, ...]) -> Skips | None:
    """Two levels of lateness in the touch events of runs (as shown), or None where one does as well, or where what
    switches them is a place, a direction or a speed. The same for the same runs, whichever model is tried on them."""
    runs = [data for data in all_runs if data.t_s.size > 10 * QUICKER]
    skip_s = _typical_skip_s(runs)
    if skip_s is None:
        return None
    tracks = side_by_side(runs)
    each = np.broadcast_to(UNSTEADY_MM2_S3, (len(runs), UNSTEADY_MM2_S3.size))
    plain, _, left = followed(tracks, 0.0, each, FAR, 1)
    best = np.argmin(np.abs(np.log(_medians(left, tracks.live) / (2 * np.log(2)))), axis=1)
    own = UNSTEADY_MM2_S3[best][:, None]
    likely, states, _ = followed(tracks, skip_s, own, SWITCH, HISTORIES)
    gains = likely[:, 0] - plain[np.arange(len(runs)), best]
    switches = np.count_nonzero(np.diff(states[..., 0], axis=0), axis=0)
    sure = gains > LEAST_EACH * np.maximum(switches, 1)
    later = [states[: data.t_s.size, k, 0] & sure[k] for k, data in enumerate(runs)]
    if np.sum(gains[sure & (switches > 0)]) < LEAST_GAIN or _has_a_reason(runs, later, gains):
        return None
    first_s = min(float(data.t_s[0]) for data in runs)
    times = [_stretches(data.t_s - first_s, on, skip_s) for data, on in zip(runs, later, strict=True)]
    return Skips(skip_s, np.sort(np.concatenate(times)), float(np.sum(gains[sure])))


@lru_cache(maxsize=4)
def change_behind(runs: tuple[RunData, ...], times_s: tuple[float, ...]) -> float | None:
    """Above which change of speed, mm/s², the filter is there, if that tells its stretches from the rest.

    Args:
        runs: with the lateness undone. times_s: (2 k,) of ``Skips``.
    """
    changes, states = [], []
    first_s = min(float(data.t_s[0]) for data in runs)
    for data in runs:
        if data.keeps_moving:
            at_s = np.arange(data.t_s[0], data.t_s[-1], GRID_S)
            fit = local_fit(data.t_s, data.xy_mm, at_s, PANELS_S)
            if np.count_nonzero(fit.ok) > 1:
                speed = np.interp(at_s, at_s[fit.ok], fit.speed_mm_s[fit.ok])
                changes.append(np.abs(np.gradient(gaussian_filter1d(speed, PANELS_S / GRID_S), GRID_S)))
                states.append(within(times_s, at_s - first_s))
    change, later = np.concatenate(changes), np.concatenate(states)
    order = np.argsort(change)
    on = later[order]
    apart = np.cumsum(~on) / max(np.count_nonzero(~on), 1) - np.cumsum(on) / max(np.count_nonzero(on), 1)
    best = int(np.argmax(apart))
    return float(change[order[best]]) if 0.5 + 0.5 * apart[best] > TOLD else None


def _typical_skip_s(runs: Sequence[RunData]) -> float | None:
    """By how much events are ahead of those beside them where the trace skips, in runs where it stands still as well;
    None where it does not. A start from rest looks like a skip, a stop like a standstill, and neither is one."""
    skips, stands = [], 0
    for data in (one for one in runs if one.keeps_moving):
        apart_s, way_mm = np.diff(data.t_s), np.hypot(*np.diff(data.xy_mm, axis=0).T)
        typical_s = float(np.median(apart_s))
        speed = median_filter(way_mm / np.maximum(apart_s, 1e-4), QUICKER)
        fast = (speed > SLOWEST_MM_S) & (np.abs(apart_s - typical_s) < OF_AN_INTERVAL * typical_s)
        if np.count_nonzero(fast) < QUICKER:
            continue
        ahead_s = (way_mm / np.maximum(speed, 1.0) - apart_s)[fast]
        least_s = max(LEAST_SKIP_S, SURE * 1.4826 * float(np.median(np.abs(ahead_s))))
        still = int(np.count_nonzero(ahead_s < -least_s))
        if still:
            skips.append(ahead_s[ahead_s > least_s])
            stands += still
    ahead_s = np.concatenate(skips) if skips else np.empty(0)
    return float(np.median(ahead_s)) if ahead_s.size >= FEWEST and stands >= FEWEST // 2 else None


def _medians(values: FloatArray, live: np.ndarray) -> FloatArray:
    """Of (n − 1, runs, g) where a run has events, (runs, g)."""
    return np.array([np.median(values[live[1:, k], k], axis=0) for k in range(values.shape[1])])


def _stretches(t_s: FloatArray, later: np.ndarray, size_s: float) -> FloatArray:
    """Times from–to, (2 k,), without the lateness. While the trace stands still, half its events seem of either."""
    changes = np.flatnonzero(np.diff(later)) + 1
    out: list[float] = []
    for first, last in pairwise([0, *changes.tolist(), t_s.size]):
        if later[first]:
            begin = 0.5 * (t_s[first - 1] + t_s[first]) - 0.5 * size_s if first else t_s[0] - size_s
            end = 0.5 * (t_s[last - 1] + t_s[last]) - size_s if last < t_s.size else t_s[-1]
            out += [float(begin), max(float(end), float(begin) + 1e-6)]
    return np.array(out)


def _has_a_reason(runs: Sequence[RunData], later: Sequence[np.ndarray], gains: FloatArray) -> bool:
    """Whether switches come at a line on the panel, at a direction of movement or at a speed, runs weighed by what
    their switches gain: it is not a filter of its own then."""
    told, weights = [], []
    for data, states, gain in zip(runs, later, gains, strict=True):
        if not np.diff(states).any():
            continue
        v = np.gradient(data.smooth_mm, data.t_s, axis=0)
        ways = v @ np.array([np.cos(DIRECTIONS), np.sin(DIRECTIONS)])
        covariates = np.column_stack([data.smooth_mm, ways, np.hypot(*v.T)])
        rank = np.argsort(np.argsort(covariates, axis=0), axis=0) / len(covariates)
        at = np.sort(rank[1:][np.diff(states)], axis=0)
        alike = [np.searchsorted(one, one + ALIKE, side="right") - np.arange(one.size) for one in at.T]
        told.append(np.max(alike, axis=1) / len(at))
        weights.append(gain)
    return bool(np.max(np.average(told, axis=0, weights=weights)) > MOSTLY)
