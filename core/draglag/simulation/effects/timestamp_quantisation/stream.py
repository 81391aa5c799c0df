"""Detector of stamps rounded by a coarse clock."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from draglag.gap.streams.stamps import CROWDED, FAST_MM_S, StreamEffect, Streams, all_sent, counted_out
from draglag.messages import message
from draglag.recording import FloatArray, Run, TouchTrace
from draglag.simulation.effects.frame_batching.stream import batches_in
from draglag.simulation.effects.poll_grid.stream import polls_in
from draglag.simulation.effects.timestamp_quantisation import TimestampQuantisation

EXACT = 2e-3  # of a tick: stamps are written to 1 µs; frames of the sample sessions jitter by 6e-3 of their interval


def detect(streams: Streams, runs: tuple[Run, ...]) -> tuple[StreamEffect | None, tuple[Run, ...]]:
    """Coarse clock, and runs with stamps of an even one."""
    coarse = streams.of(clock_in)
    return coarse, runs if coarse is None else tuple(replace(r, touch=evened(r.touch, coarse.value)) for r in runs)


def clock_in(streams: Streams) -> StreamEffect | None:
    """Coarse clock, unless by polls or batches."""
    other = streams.of(polls_in) is not None or streams.of(batches_in) is not None
    return None if other else coarse_clock(streams.touches, streams.unsent_mm)


def coarse_clock(touches: list[TouchTrace], unsent_mm: tuple[float, float] = (0.0, 0.0)) -> StreamEffect | None:
    """Coarse clock: stamps are multiples of a quantum while intervals vary.

    unsent_mm: steps of x and y where a frame in which neither changed is not sent; else 0.
    """
    intervals = np.concatenate([_of_sent(touch, unsent_mm) for touch in touches])
    if not intervals.size:
        return None
    at_once = bool(np.mean(intervals < 1e-4) > CROWDED)
    quantum_s = _smallest_gap_s(intervals, at_once)
    typical = float(np.mean(intervals))
    if quantum_s is None or quantum_s < 0.08 * typical or (quantum_s > 2.5 * typical and not at_once):
        return None
    # Refined on whole multiples, then every interval must be one.
    whole = np.round(intervals / quantum_s)
    good = whole > 0
    quantum_s = float(np.sum(intervals[good]) / np.sum(whole[good]))
    off = np.abs(intervals - quantum_s * np.round(intervals / quantum_s))
    share = float(np.mean(off < 0.03 * quantum_s))
    if share < 0.95 or np.mean(np.round(intervals / quantum_s) == np.round(typical / quantum_s)) > 0.999:
        return None
    if at_once and np.median(off) > EXACT * quantum_s:
        return None  # frames that jitter, and bursts after the pauses of a host
    missing = _reaches_further(touches) > 0.5
    if missing and not at_once:
        return None  # frames of an even clock, some of them lost
    return StreamEffect(
        TimestampQuantisation.id,
        "quantum_s",
        quantum_s,
        (0.99 * quantum_s, 1.01 * quantum_s),
        message("every stamp"),
        f"{100 * share:.0f} % of intervals are multiples of {1e3 * quantum_s:.2f} ms",
        share,
        undone=not missing,  # which frame a stamp is of is then not sure
    )


def _of_sent(touch: TouchTrace, unsent_mm: tuple[float, float]) -> FloatArray:
    """Intervals without those in which frames may not have been sent."""
    dt = np.diff(touch.t_s)
    return np.asarray(dt[all_sent(touch.t_s, touch.x_mm, touch.y_mm, float(np.median(dt)), unsent_mm)])


def _smallest_gap_s(intervals: FloatArray, at_once: bool) -> float | None:
    """Smallest difference between frequent intervals; None where few are frequent. ``at_once``: some frames come in
    one tick of the clock."""
    rounded = np.round(intervals, 7)
    least = max(20, 5e-4 * intervals.size)
    values, counts = np.unique(np.round(rounded / 2e-5).astype(int), return_counts=True)
    common = values[counts > least] * 2e-5
    common = common[common > 1e-4]
    if common.size == 0 or np.sum(counts[counts > least]) < 0.9 * intervals.size:
        return None
    common = np.sort(common)
    gaps = np.diff(common)
    gaps = gaps[gaps > 0.02 * common[1:]]  # the bins split some
    if at_once:
        gaps = np.append(gaps, common[0])  # frames within one tick of the clock bear one stamp
    return float(np.min(gaps)) if gaps.size else None


def _reaches_further(touches: list[TouchTrace]) -> float:
    """Extra way in longer intervals: 1 with missing frames, 0 with coarse stamps; median over fast runs."""
    shares = []
    for touch in touches:
        dt = np.diff(touch.t_s)
        step = np.hypot(np.diff(touch.x_mm), np.diff(touch.y_mm))
        short_s = float(np.median(dt))
        short, long = np.abs(dt - short_s) < 0.2 * short_s, (dt > 1.4 * short_s) & (dt < 3.5 * short_s)
        if min(np.count_nonzero(long), np.count_nonzero(short)) < 10 or float(step.sum() / np.sum(dt)) < FAST_MM_S:
            continue
        further = float(np.mean(step[long]) / np.mean(step[short])) - 1
        shares.append(further / (float(np.mean(dt[long]) / np.mean(dt[short])) - 1))
    return float(np.median(shares)) if shares else 0.0


def evened(touch: TouchTrace, quantum_s: float) -> TouchTrace:
    """Trace with stamps of an even frame clock, their slow course kept."""
    t = touch.t_s
    if t.size < 100:
        return touch
    typical = np.diff(t)
    frame_s = float((t[-1] - t[0]) / (t.size - 1))
    if np.mean(typical < 0.25 * quantum_s) > CROWDED:
        longest_s = 1.5 * quantum_s  # of one frame to the next: on a clock coarser than they, some share a tick
    else:
        # On a clock coarser than half a frame, one frame and two may lie as far apart.
        longest_s = (1.5 if quantum_s < 0.45 * frame_s else 2.5) * frame_s
    frame_s = float(np.mean(typical[typical < longest_s]))
    count = np.concatenate([[0], np.cumsum(np.where(typical < longest_s, 1, np.round(typical / frame_s)))])
    return replace(touch, t_s=counted_out(t, count, frame_s, quantum_s))
