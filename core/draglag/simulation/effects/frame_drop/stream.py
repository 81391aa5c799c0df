"""Detector of lost frames."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from draglag.gap.streams.stamps import StreamEffect, Streams, all_sent, nothing_repeats, share_interval
from draglag.messages import message
from draglag.recording import Run, TouchTrace
from draglag.simulation.effects.deadband.stream import deadband_in
from draglag.simulation.effects.frame_batching.stream import batches_in, ends_of_batches
from draglag.simulation.effects.frame_drop import FrameDrop
from draglag.simulation.effects.poll_grid.stream import polls_in
from draglag.simulation.effects.sample_hold.stream import loop_in
from draglag.simulation.effects.timestamp_quantisation.stream import clock_in

LEAST_HOLE, LONGEST_HOLE = 6, 60  # frames from one event to the next, where others are lost
UNSURE = 0.3  # of the share of missing frames, where a coarse clock leaves open which frame a stamp is of


def detect(streams: Streams, runs: tuple[Run, ...]) -> tuple[StreamEffect | None, tuple[Run, ...]]:
    """Lost frames, if stamps are those of frames; runs unchanged."""
    coarse = streams.of(clock_in)
    identifiable = streams.of(loop_in) is None if coarse is None else not coarse.undone
    if not identifiable or streams.of(polls_in) is not None:
        return None, runs
    if nothing_repeats(streams.touches) and streams.of(deadband_in) is not None:
        return None, runs  # nothing had changed
    batched = streams.of(batches_in)
    dropped = drops(streams.touches, 1 if batched is None else round(batched.value), streams.unsent_mm)
    if dropped is None or coarse is None:
        return dropped, runs
    low, high = (share * one for share, one in zip((1 - UNSURE, 1 + UNSURE), dropped.ci95, strict=True))
    return replace(dropped, ci95=(low, min(high, 1.0))), runs


def drops(
    touches: list[TouchTrace], together: int = 1, unsent_mm: tuple[float, float] = (0.0, 0.0)
) -> StreamEffect | None:
    """Lost frames, from intervals of several whole frames.

    together: frames per batch. unsent_mm: steps of x and y where a frame in which neither changed is not sent; else 0.
    """
    whole, short = [], 0
    for touch in touches:
        which = np.arange(touch.t_s.size) if together == 1 else ends_of_batches(touch.t_s)
        dt = np.diff(touch.t_s[which])
        frame_s = float(np.median(dt)) / together
        if frame_s <= 0:
            continue
        dt = dt - (together - 1) * frame_s
        n_frames = np.round(dt / frame_s)
        near = np.abs(dt - n_frames * frame_s) < 0.2 * frame_s
        near &= all_sent(touch.t_s[which], touch.x_mm[which], touch.y_mm[which], frame_s, unsent_mm)
        # What comes at once after a pause was held back, not lost.
        short += int(np.count_nonzero(near & (n_frames == 0)))
        whole.append(n_frames[near & (n_frames >= 1) & (n_frames <= LONGEST_HOLE)].astype(np.int64))
    of_length = np.bincount(np.concatenate(whole or [np.zeros(0, np.int64)]), minlength=LONGEST_HOLE + 2)
    # Longer holes are the tail of the shorter ones up to the first length that is not there: then, contact was lost.
    of_length = of_length[: max(int(np.argmin(of_length[1:] > 0)) + 1, LEAST_HOLE + 1)]
    frames = np.arange(of_length.size)
    lost = int(of_length[2:] @ (frames[2:] - 1)) - short
    total = int(of_length @ (frames + together - 1))
    in_bursts = float(of_length[2:] @ (frames[2:] - 1) ** 2)
    share = lost / max(total, 1)
    mean_hole = lost / max(int(of_length[2:].sum()), 1)
    if share < 0.03:
        return None
    return StreamEffect(
        FrameDrop.id,
        "share",
        share,
        share_interval(lost, max(total, 1), in_bursts / lost),
        message(
            "{n:.2g} frames at a time, all through" if mean_hole > 1.2 else "single frames, all through", n=mean_hole
        ),
        f"{100 * share:.1f} % of frames are missing",
        share,
    )
