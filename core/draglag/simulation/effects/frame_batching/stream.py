"""Detector of frames delivered in batches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from draglag.gap.streams.stamps import StreamEffect, Streams
from draglag.messages import message
from draglag.recording import FloatArray, IntArray, Run, TouchTrace
from draglag.simulation.effects.frame_batching import FrameBatching
from draglag.simulation.effects.poll_grid.stream import polls_in

TOGETHER = 0.25  # of the mean interval: frames that lie closer came together
WHOLE = 0.5  # of a frame, by which a batch that lacks none may come early or late


def detect(streams: Streams, runs: tuple[Run, ...]) -> tuple[StreamEffect | None, tuple[Run, ...]]:
    """Batches, and runs with a time for each frame."""
    batched = streams.of(batches_in)
    if batched is None:
        return None, runs
    return batched, tuple(replace(r, touch=spread(r.touch, round(batched.value))) for r in runs)


def batches_in(streams: Streams) -> StreamEffect | None:
    """Batches, unless by a host's polls."""
    return None if streams.of(polls_in) is not None else batches(streams.touches)


def batches(touches: list[TouchTrace]) -> StreamEffect | None:
    """Groups of one size of nearly simultaneous frames."""
    sizes: list[int] = []
    for touch in touches:
        dt = np.diff(touch.t_s)
        typical = (touch.t_s[-1] - touch.t_s[0]) / max(dt.size, 1)
        together = dt < TOGETHER * typical
        if np.mean(together) < 0.3:
            return None
        ends = np.flatnonzero(np.append(~together, True))
        sizes += list(np.diff(np.append(-1, ends)))
    size = int(np.median(sizes))
    if size < 2:
        return None
    right = float(np.mean(np.array(sizes) == size))
    if right < 0.6 or (right < 0.995 and _exact_grid(touches)):
        return None
    return StreamEffect(
        FrameBatching.id,
        "frames",
        float(size),
        (float(size), float(size)),
        message("every frame"),
        f"frames arrive {size} at a time in {100 * right:.0f} % of groups",
        right,
    )


def _exact_grid(touches: list[TouchTrace]) -> bool:
    """Whether stamps are a clock's ticks, not frames."""
    apart_s = np.concatenate([np.diff(touch.t_s) for touch in touches])
    tick_s = float(np.median(apart_s[apart_s > 0.25 * np.mean(apart_s)]))
    off_s = np.abs(apart_s - tick_s * np.round(apart_s / tick_s))
    return bool(np.mean(off_s < 1e-3 * tick_s) > 0.95)


def spread(touch: TouchTrace, size: int) -> TouchTrace:
    """Trace with a batch's frames a frame apart, the last at its stamp; of an incomplete batch only the last."""
    if touch.t_s.size < 3:
        return touch
    ends = ends_of_batches(touch.t_s)
    apart_s = np.diff(touch.t_s[ends], prepend=np.nan)
    frame_s = float(np.nanmedian(apart_s)) / size
    which = np.searchsorted(ends, np.arange(touch.t_s.size))
    t_s = touch.t_s[ends[which]] - (ends[which] - np.arange(touch.t_s.size)) * frame_s
    whole = ~(np.abs(apart_s - size * frame_s) > WHOLE * frame_s)  # the first one too
    keep = whole[which] | (ends[which] == np.arange(touch.t_s.size))
    ids = touch.contact_id[keep] if touch.contact_id.size == keep.size else touch.contact_id
    return TouchTrace(t_s[keep], touch.x_mm[keep], touch.y_mm[keep], ids, gaps_s=touch.gaps_s)


def ends_of_batches(t_s: FloatArray) -> IntArray:
    """Index of the last frame of each batch."""
    frame_s = (t_s[-1] - t_s[0]) / (t_s.size - 1)
    return np.flatnonzero(np.append(np.diff(t_s) >= TOGETHER * frame_s, True))
