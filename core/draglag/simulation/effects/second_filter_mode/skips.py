"""An intermittent filter in touch events: the trace stands still when it begins and skips when it ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from draglag.path.local_fit import local_fit
from draglag.recording import FloatArray
from draglag.simulation.effects.second_filter_mode.lateness import without_lateness
from draglag.simulation.effects.second_filter_mode.setting import By, Setting, within
from draglag.simulation.effects.second_filter_mode.tracker import stack_runs, track, track_histories, tracker_gains

if TYPE_CHECKING:
    from draglag.gap.traces.run_data import RunData

QUICKER = 9  # events over which a step is compared with its neighbours: a skip takes one or two
SLOWEST_MM_S = 60.0  # slower, a skip of some milliseconds is within the noise
LEAST_SKIP_S, SURE = 0.003, 6.0  # and robust deviations of the run's own steps
OF_AN_INTERVAL = 0.5  # more or less, frames were lost or held back, not the stylus
FEWEST = 12  # skips, and half as many standstills
UNSTEADY_MM2_S3 = np.geomspace(1e3, 1e6, 4)  # power of a hand's random acceleration
LEAST_EACH = 4.0  # log-likelihood for each switch of a run; what a tremor makes up comes to 2 to 5
LEAST_OF_A_RUN = 50.0  # of a run: one that stays late gains up to 35 where nothing switches
QUIETER = 0.25  # of the runs; without, the two fastest runs of a 60 Hz panel show no filter
UNDISTURBED = 0.2  # of a run's events, at least, come after no skip
LEAST_GAIN = 1000.0  # of all runs, at their likeliest noises; held positions with lost frames come to some 300
DIRECTIONS = np.pi / 4 * np.arange(4)
GRID_S, PANELS_S = 0.005, 0.05  # a panel's own smoothing of a speed, about
MIN_ACCURACY = 0.85  # balanced accuracy with which a threshold of the speed, or of its change, separates both states
ALIKE = 0.2  # of a run's events by place, direction or speed, or of its time, within which lie …
# … so many of its switches: those are no filter's. Of the trace's skips as they are it is more: of generated filters
# 0.59 to 0.79, of split panels, asymmetries and slow runs' noise 0.84 to 1. By time, of generated filters 0.24 to 0.35,
# of latencies that settle 0.63 to 1.
MOSTLY_ALIKE, NEARLY_ALL = 0.6, 0.85


@dataclass(frozen=True)
class Skips:
    """Lateness; (2 k,) its stretches from–to in session time, as the trace without it shows; gain in log-likelihood.

    above_mm_s: the speed that switches it, if one does.
    """

    size_s: float
    times_s: FloatArray
    gain: float
    above_mm_s: float | None

    @property
    def setting(self) -> Setting:
        """Setting of the term: most runs lie on one side of a speed that switches, and show no switch."""
        if self.above_mm_s is not None:
            return Setting(self.above_mm_s, By.SPEED)
        return Setting(self.size_s, By.TIME_SHOWN, tuple(self.times_s.tolist()))


@lru_cache(maxsize=1)
def find_skips(all_runs: tuple[RunData, ...]) -> Skips | None:
    """Two levels of lateness in runs as shown; None if one suffices, or place or direction switches them."""
    runs = [data for data in all_runs if data.t_s.size > 10 * QUICKER]
    skip_s = _typical_skip_s([data for data in runs if data.keeps_moving])
    if skip_s is None:
        return None
    gains, ratios, states = _likelier_histories(runs, skip_s)
    if np.sum(np.maximum(ratios, 0.0)) < LEAST_GAIN:
        return None
    switches = np.count_nonzero(np.diff(states, axis=0), axis=0)
    shown = (switches > 0) & (gains > LEAST_OF_A_RUN + LEAST_EACH * switches)
    if not shown.any():
        return None
    later = [states[: data.t_s.size, k] & shown[k] for k, data in enumerate(runs)]
    if _alike(runs, [np.flatnonzero(np.diff(on)) + 1 for on in later], gains) > MOSTLY_ALIKE:
        return None
    first_s = min(float(data.t_s[0]) for data in runs)
    each = [_stretches(data.t_s - first_s, on, skip_s) for data, on in zip(runs, later, strict=True)]
    times_s = np.sort(np.concatenate(each))
    switching = [data for data, own in zip(runs, shown, strict=True) if own and data.keeps_moving]
    freed = [without_lateness(data.t_s, data.xy_mm, skip_s, first_s + times_s) for data in switching]
    speeds = [(speed, within(tuple(times_s), at_s - first_s)) for at_s, speed in map(_speeds, freed)]
    above_mm_s, accuracy = _separated(speeds)
    by_speed = above_mm_s if accuracy > MIN_ACCURACY else None
    return Skips(skip_s, times_s, float(np.sum(gains[shown])), by_speed)


def _likelier_histories(runs: Sequence[RunData], skip_s: float) -> tuple[FloatArray, FloatArray, np.ndarray]:
    """Log-likelihood gained over one level of lateness, (runs,), at one noise and hand, and at each level's own
    likeliest; states (n, runs)."""
    tracks = stack_runs(runs)
    # Where the stylus is fast, skips themselves pass for noise: that of the quieter runs is tried, too.
    own_mm = np.array([data.noise_mm for data in runs])
    noise_mm = np.column_stack([own_mm, np.minimum(own_mm, np.quantile(own_mm, QUIETER))])
    shape = (*noise_mm.shape, UNSTEADY_MM2_S3.size)
    each_mm, hand = (np.broadcast_to(a, shape).reshape(len(runs), -1) for a in (noise_mm[..., None], UNSTEADY_MM2_S3))
    settings = tracker_gains(tracks, each_mm, hand)
    plain, left = track(tracks, settings)
    off = np.abs(np.log(_low_quantiles(left, tracks.live) / -np.log(1 - UNDISTURBED))).reshape(shape)
    best = (*np.ogrid[: shape[0], : shape[1]], np.argmin(off, axis=2))
    likely, states = track_histories(tracks, skip_s, settings.reshape(*settings.shape[:2], *shape)[:, :, *best])
    gains = likely - plain.reshape(shape)[best]
    run, pick = np.arange(len(runs)), np.argmax(gains, axis=1)
    return gains[run, pick], likely.max(axis=1) - plain.max(axis=1), states[:, run, pick]


@lru_cache(maxsize=4)
def threshold_of_change(runs: tuple[RunData, ...], times_s: tuple[float, ...]) -> float | None:
    """Acceleration threshold, mm/s², that separates the filter's stretches, if any. runs: with the lateness undone."""
    from scipy.ndimage import gaussian_filter1d

    first_s = min(float(data.t_s[0]) for data in runs)
    each = []
    for data in runs:
        if data.keeps_moving:
            at_s, speed = _speeds((data.t_s, data.xy_mm))
            if not at_s.size:
                continue
            change = np.abs(np.gradient(gaussian_filter1d(speed, PANELS_S / GRID_S), GRID_S))
            each.append((change, within(times_s, at_s - first_s)))
    threshold, accuracy = _separated(each)
    return threshold if accuracy > MIN_ACCURACY else None


def _speeds(events: tuple[FloatArray, FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Times and speeds (g,) of a trace; none if too few events have one."""
    at_s = np.arange(events[0][0], events[0][-1], GRID_S)
    fit = local_fit(*events, at_s, PANELS_S)
    if np.count_nonzero(fit.ok) < 2:
        return np.empty(0), np.empty(0)
    return at_s, np.interp(at_s, at_s[fit.ok], fit.speed_mm_s[fit.ok])


def _separated(each: Sequence[tuple[FloatArray, np.ndarray]]) -> tuple[float, float]:
    """Threshold above which a state is taken for the later one, and the balanced accuracy. each: values and states."""
    values, states = (np.concatenate(arrays) for arrays in zip(*each, strict=True)) if each else np.empty((2, 0))
    if values.size == 0:
        return 0.0, 0.0
    order = np.argsort(values)
    on = states[order]
    off = np.logical_not(on)
    separation = np.cumsum(off) / max(np.count_nonzero(off), 1) - np.cumsum(on) / max(np.count_nonzero(on), 1)
    best = int(np.argmax(separation))
    return float(values[order[best]]), float(0.5 + 0.5 * separation[best])


def _typical_skip_s(runs: Sequence[RunData]) -> float | None:
    """Typical skip in runs that also stand still; None as in ``find_skips``."""
    from scipy.ndimage import median_filter

    skips, standstills, at = [], 0, []
    for data in runs:
        apart_s, way_mm = np.diff(data.t_s), np.hypot(*np.diff(data.xy_mm, axis=0).T)
        typical_s = float(np.median(apart_s))
        speed = median_filter(way_mm / np.maximum(apart_s, 1e-4), QUICKER)
        fast = (speed > SLOWEST_MM_S) & (np.abs(apart_s - typical_s) < OF_AN_INTERVAL * typical_s)
        ahead_s = np.where(fast, way_mm / np.maximum(speed, 1.0) - apart_s, 0.0)
        least_s = LEAST_SKIP_S
        if fast.any():
            least_s = max(least_s, SURE * 1.4826 * float(np.median(np.abs(ahead_s[fast]))))
        still = int(np.count_nonzero(ahead_s < -least_s)) if np.count_nonzero(fast) >= QUICKER else 0
        at.append(np.flatnonzero(np.abs(ahead_s) > least_s) + 1 if still else np.empty(0, int))
        if still:
            own = ahead_s[ahead_s > least_s]
            skips.append(np.column_stack([own, np.full(own.size, least_s**-2.0)]))
            standstills += still
    each = np.concatenate(skips) if skips else np.empty((0, 2))
    if len(each) < FEWEST or standstills < FEWEST // 2 or _alike(runs, at, [one.size for one in at]) > NEARLY_ALL:
        return None
    size_s, weight = each[np.argsort(each[:, 0])].T
    return float(size_s[np.searchsorted(np.cumsum(weight), 0.5 * weight.sum())])  # the slower, the more is noise


def _low_quantiles(values: FloatArray, live: np.ndarray) -> FloatArray:
    """Quantile ``UNDISTURBED`` over a run's events, (runs, g)."""
    return np.array([np.quantile(values[live[1:, k], k], UNDISTURBED, axis=0) for k in range(values.shape[1])])


def _stretches(t_s: FloatArray, later: np.ndarray, size_s: float) -> FloatArray:
    """Times from–to, (2 k,), without the lateness."""
    changes = np.flatnonzero(np.diff(later)) + 1
    out: list[float] = []
    for first, last in pairwise([0, *changes.tolist(), t_s.size]):
        if later[first]:
            begin = 0.5 * (t_s[first - 1] + t_s[first]) - 0.5 * size_s if first else t_s[0] - size_s
            end = 0.5 * (t_s[last - 1] + t_s[last]) - size_s if last < t_s.size else t_s[-1]
            out += [float(begin), max(float(end), float(begin) + 1e-6)]
    return np.array(out)


def largest_alike(values: FloatArray) -> float:
    """Largest share of the values (n,) that lies within ``ALIKE``."""
    ordered = np.sort(values)
    count = np.searchsorted(ordered, ordered + ALIKE, side="right") - np.arange(ordered.size)
    return float(count.max(initial=0)) / max(ordered.size, 1)


def _alike(runs: Sequence[RunData], at: Sequence[np.ndarray], weights: Sequence[float] | FloatArray) -> float:
    """Share of switches within ``ALIKE`` of events by place, direction or speed. at: indices of switching events."""
    shares = []
    for data, events in zip(runs, at, strict=True):
        if events.size:
            v = np.gradient(data.smooth_mm, data.t_s, axis=0)
            ways = v @ np.array([np.cos(DIRECTIONS), np.sin(DIRECTIONS)])
            covariates = np.column_stack([data.smooth_mm, ways, np.hypot(*v.T)])
            rank = np.argsort(np.argsort(covariates, axis=0), axis=0) / len(covariates)
            shares.append([largest_alike(one) for one in rank[events].T])
    own = [weight for weight, events in zip(weights, at, strict=True) if events.size]
    return float(np.max(np.average(shares, axis=0, weights=own)))
