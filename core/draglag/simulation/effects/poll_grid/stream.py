"""Detector of polls: frame i comes with the first tick of a jittering grid after i periods of the panel."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.special import ndtr

from draglag.gap.streams.stamps import BEAT, StreamEffect, Streams, counted_out
from draglag.messages import message
from draglag.recording import FloatArray, IntArray, Run, TouchTrace
from draglag.simulation.effects.poll_grid import PollGrid

FINEST = 12  # ticks that the usual interval may have
ROUNDING_S = 2e-6  # of stamps in whole µs, and of the fit to them
MAX_SCATTER = 0.12  # of a tick: intervals that scatter by more are on no grid
SHORTEST_S = (
    1.5e-3  # hosts poll USB every 1 ms at best: that wait, 0.5 ms with a scatter of 0.3, is part of any latency
)
WINDOWS = (64, 512)  # events over which the panel's clock keeps its phase
FEWEST, ENOUGH = 16, 8000  # events of a window that counts; events that are enough
PHASES = np.linspace(-1.3, 0.3, 48)  # of the first event of a window, in ticks
JITTERS = (0.01, 0.03, 0.1, 0.25)  # of the panel's own frames, in ticks
# Ticks after a frame at which probabilities are looked up. Derived: eight standard deviations of the largest jitter on
# either side, at steps of a twentieth of the smallest.
LATE = np.arange(-8 * JITTERS[-1], 1 + 8 * JITTERS[-1], JITTERS[0] / 20)
LOST = (0.003, 0.01)  # share of frames that do not arrive, where counting begins; of more than 1 % no beat is seen
P_OUTLIER = 1e-3  # share of events that may be anywhere
MIN_LOG_RATIO = 10.0  # nats
FAR = 12.0  # robust standard deviations, within which an arrival is one of the usual
UNSURE_JITTER = 0.15  # of its size: events of one poll keep their order
EARLY = 0.15  # of a tick: a frame may come so much later than its clock says
FOLLOWED = 0.2  # of what a frame lies beyond its poll


@dataclass(frozen=True)
class _Grid:
    """One run's stamps on the grid: ticks (n,), period, deviations (n,)."""

    tick: IntArray
    period_s: float
    off_s: FloatArray


@dataclass(frozen=True)
class Polled:
    """Polling, and the panel's frame interval."""

    effect: StreamEffect
    frame_s: float


def detect(streams: Streams, runs: tuple[Run, ...]) -> tuple[StreamEffect | None, tuple[Run, ...]]:
    """Polls, and runs with stamps of the panel's frames."""
    waited = streams.of(polls_in)
    if waited is None:
        return None, runs
    return waited.effect, tuple(replace(r, touch=unpolled(r.touch, waited.effect.value, waited.frame_s)) for r in runs)


def polls_in(streams: Streams) -> Polled | None:
    """Polling of the host, if any."""
    return polled(streams.touches)


def polled(touches: Sequence[TouchTrace]) -> Polled | None:
    """Polling, if likelier than frames that are the grid or a clock that rounds."""
    grids = _grids(touches)
    if not grids or grids[0].period_s < SHORTEST_S or _scatter_of_grid(grids) * grids[0].period_s < ROUNDING_S:
        return None  # no grid, a wait too short for a name, or a clock that rounds
    frames = max((_beat(grids, longest) for longest in WINDOWS), key=lambda found: found[0])
    if frames[0] < MIN_LOG_RATIO:
        return None
    each_s = np.array([grid.period_s for grid in grids])
    period_s = float(np.mean(each_s))
    reach_s = 1.96 * float(np.std(each_s)) / math.sqrt(each_s.size) + 1e-5 * period_s
    scatter = np.array([_of_most(grid.off_s) for grid in grids])
    jitter_s = float(np.mean(scatter))
    jitter_reach_s = 1.96 * float(np.std(scatter)) / math.sqrt(scatter.size) + UNSURE_JITTER * jitter_s
    frame_s = frames[1] * period_s
    effect = StreamEffect(
        PollGrid.id,
        "period_s",
        period_s,
        (period_s - reach_s, period_s + reach_s),
        message("every stamp"),
        f"stamps lie on a grid of {1e3 * period_s:.2f} ms to {1e6 * jitter_s:.0f} µs; the panel's frames come every "
        f"{1e3 * frame_s:.2f} ms",
        1.0,
        undone=all(_even_again(touch, period_s, frame_s) for touch in touches),
        also=(("jitter_s", jitter_s, (max(jitter_s - jitter_reach_s, 0.0), jitter_s + jitter_reach_s)),),
    )
    return Polled(effect, frame_s)


def unpolled(touch: TouchTrace, period_s: float, frame_s: float) -> TouchTrace:
    """Trace stamped by the panel's even frames; the mean wait stays."""
    if touch.t_s.size < 100:
        return touch
    count = _frames(_on_grid(touch.t_s, period_s).tick, frame_s / period_s)
    typical_s = float(np.polyfit(count, touch.t_s, 1)[0])
    return replace(touch, t_s=counted_out(touch.t_s, count, typical_s, period_s))


def _frames(tick: IntArray, frame: float) -> FloatArray:
    """Frame number of each event, (n,)."""
    count, begun = [0], 0.0
    for now in (tick - tick[0]).tolist():
        waited = now - begun - frame * (count[-1] + 1)
        missing = max(math.ceil((waited - 1 - EARLY) / frame), 0)
        waited -= missing * frame
        count.append(count[-1] + 1 + missing)
        begun += FOLLOWED * (min(waited, 0.0) + max(waited - 1, 0.0))  # the panel's clock wanders
    return np.array(count[1:], float)


def _grids(touches: Sequence[TouchTrace]) -> list[_Grid]:
    """Stamps on the grid of least relative scatter; empty without any."""
    apart_s = np.concatenate([np.diff(touch.t_s) for touch in touches])
    usual_s = float(np.mean(apart_s))
    apart_s = apart_s[(apart_s > 0.25 * usual_s) & (apart_s < 6 * usual_s)]
    if apart_s.size <= 50:
        return []
    best: list[_Grid] = []
    smallest, median_s = MAX_SCATTER, float(np.median(apart_s))
    for parts in range(1, FINEST + 1):
        period_s = median_s / parts
        for _ in range(3):
            whole = np.maximum(np.round(apart_s / period_s), 1)
            near = np.abs(apart_s - whole * period_s) < 0.25 * period_s
            period_s = float(np.sum(apart_s[near]) / np.sum(whole[near])) if near.any() else period_s
        # intervals scatter by the square root of two as much as stamps, whole runs by no less
        if _spread(apart_s - period_s * np.round(apart_s / period_s)) > 2 * smallest * period_s:
            continue
        grids = [_on_grid(touch.t_s, period_s) for touch in touches]
        if (scatter := _scatter_of_grid(grids)) < smallest:
            best, smallest = grids, scatter
    return best


def _scatter_of_grid(grids: Sequence[_Grid]) -> float:
    return float(np.median([_spread(grid.off_s) / grid.period_s for grid in grids]))


def _spread(values: FloatArray) -> float:
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))


def _of_most(values: FloatArray) -> float:
    off = values - np.median(values)
    return float(np.std(off[np.abs(off) < FAR * _spread(values)]))


def _on_grid(t_s: FloatArray, period_s: float) -> _Grid:
    tick = np.zeros(t_s.size, np.int64)
    off_s = np.zeros(t_s.size)
    for _ in range(2):
        tick = np.concatenate([[0], np.cumsum(np.round(np.diff(t_s) / period_s))]).astype(np.int64)
        along = tick - np.mean(tick)
        period_s = float(along @ (t_s - t_s[0]) / max(float(along @ along), 1.0))
        off_s = t_s - np.mean(t_s) - period_s * along
    return _Grid(tick, period_s, off_s)


def _beat(grids: Sequence[_Grid], longest: int) -> tuple[float, float]:
    """Log-likelihood over ``_of_neighbours``; frame period in ticks."""
    steps = np.concatenate([np.diff(grid.tick) for grid in grids])
    usual = float(np.mean(steps[steps <= 3 * max(float(np.median(steps)), 1.0)]))
    windows = [window for grid in grids for window in _windows(grid.tick, int(np.ceil(usual)) + 1, longest)]
    if not windows or np.mean(steps == np.median(steps)) == 1:
        return -np.inf, usual
    windows = windows[:: int(np.ceil(sum(w.size for w in windows) / ENOUGH))]
    apart = _apart(windows)
    counted = ([part for w in windows for part in _without_lost(w, apart * (1 - lost))] for lost in LOST)
    return max((_beat_in(parts) for parts in (windows, *counted) if parts), key=lambda found: found[0])


def _apart(windows: Sequence[IntArray]) -> float:
    return float(sum(w[-1] - w[0] for w in windows) / sum(w.size - 1 for w in windows))


def _without_lost(tick: IntArray, frame: float) -> list[IntArray]:
    parts = np.split(tick, np.flatnonzero(np.diff(_frames(tick, frame)) > 1) + 1)
    return [part for part in parts if part.size >= FEWEST]


def _beat_in(windows: Sequence[IntArray]) -> tuple[float, float]:
    frame = _apart(windows)
    if frame == 0:
        return -np.inf, frame  # stamps of whole seconds
    sizes = sorted({window.size for window in windows})
    alike = [np.array([window for window in windows if window.size == size]) for size in sizes]
    by_beat = float(np.max(sum(_of_beat(ticks, frame) for ticks in alike)))
    return by_beat - _of_neighbours(windows, frame), frame


def _windows(tick: IntArray, most: int, longest: int) -> list[IntArray]:
    """Stretches without surely missing events."""
    parts = np.split(tick, np.flatnonzero(np.diff(tick) > most) + 1)
    cut = [part[k : k + longest] for part in parts for k in range(0, part.size, longest)]
    return [window for window in cut if window.size >= FEWEST]


def _of_beat(ticks: IntArray, frame: float) -> FloatArray:
    """Log-likelihoods (j,) at each jitter of the ticks of windows (w, n) under a beat, of any phase in each."""
    at = frame * np.arange(ticks.shape[1]) + PHASES[:, None]
    late = (ticks - ticks[:, :1])[:, None] - at
    place = ((late - LATE[0]) / (LATE[1] - LATE[0]) + 0.5).clip(0, LATE.size - 1).astype(np.int32)
    of_phase = np.array([log_p.take(place).sum(axis=2) for log_p in _log_probabilities()])
    return np.asarray(np.sum(np.logaddexp.reduce(of_phase, axis=2) - np.log(PHASES.size), axis=1))


@cache
def _log_probabilities() -> FloatArray:
    """Log probability (j, l) at each jitter of a tick that comes ``LATE`` after its frame."""
    jitter = np.array(JITTERS)[:, None]
    each = ndtr(LATE / jitter) - ndtr((LATE - 1) / jitter)
    return np.asarray(np.log((1 - P_OUTLIER) * each + P_OUTLIER / 4))


def _of_neighbours(windows: Sequence[IntArray], frame: float) -> float:
    """Log-likelihood (BIC) of steps that depend on the last one to three, or on as many as come with a tick."""
    kinds, each = np.unique(np.concatenate([np.diff(window) for window in windows]), return_inverse=True)
    in_window = np.concatenate([np.arange(window.size - 1) for window in windows])
    before, best = np.zeros(each.size, np.int64), -np.inf  # which steps went before
    for order in range(1, max(round(1 / frame), 3) + 1):
        before[1:] = before[:-1] * kinds.size + each[:-1]
        before = np.unique(before, return_inverse=True)[1]
        whole = in_window >= order
        if not whole.any():
            break  # no window is that long
        followed, counts = np.unique(before[whole] * kinds.size + each[whole], return_counts=True)
        totals = np.bincount(followed // kinds.size, weights=counts)
        totals = totals[totals > 0]
        free, events = counts.size - totals.size, int(counts.sum())
        likelihood = float(counts @ np.log(counts) - totals @ np.log(totals))
        best = max(best, likelihood - 0.5 * free * math.log(max(events, 1)))
    return best


def _even_again(touch: TouchTrace, period_s: float, frame_s: float) -> bool:
    """Whether stamps lie within a period of their replacements."""
    if touch.t_s.size < 100:
        return True
    wait_s = touch.t_s - unpolled(touch, period_s, frame_s).t_s
    return bool(np.ptp(np.quantile(wait_s, [0.01, 0.99])) < BEAT * period_s)
