"""Detector of a host's sample-and-hold loop."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from draglag.gap.streams.interpolated import reports_a_scan_in
from draglag.gap.streams.stamps import StreamEffect, Streams, first_of_repeats, repeats
from draglag.messages import message
from draglag.recording import Run, TouchTrace
from draglag.simulation.effects.deadband.stream import deadband_in
from draglag.simulation.effects.frame_batching.stream import batches_in
from draglag.simulation.effects.pitch_ripple.lattice import lattice_of
from draglag.simulation.effects.poll_grid import PollGrid
from draglag.simulation.effects.poll_grid.stream import polls_in
from draglag.simulation.effects.sample_hold import SampleHold
from draglag.simulation.effects.sample_hold.ages import UNEVEN_AGE, ages_remain, uneven_age_s
from draglag.simulation.effects.sample_hold.undo_sample_hold import undo_sample_hold
from draglag.simulation.effects.timestamp_quantisation.stream import clock_in

BUS_S = (0.002, 0.004, 0.008, 0.016, 0.032)  # intervals at which USB hosts poll: powers of two of its frames
BUS_CLOCK = 5e-4  # by which the bus's clock may differ from the kernel's: its specification's tolerance
FEW_REPEATS = 0.02  # of positions: more than accidents make
# Of a period: most stamps of a loop lie within the first, half of them within the second, or within the jitter of
# arrivals (usual panels' frames jitter by 3 %). Physical (fact sheet on real screens).
REGULAR, MEDIAN, ARRIVAL_S = 0.03, 0.005, 4e-5
MOST = 0.97  # of the stamps: a busy host delays single ones. Judgement
STEPS = 3.0  # of its coordinates that a run advances by from event to event, where a repeat means something


def detect(streams: Streams, runs: tuple[Run, ...]) -> tuple[StreamEffect | None, tuple[Run, ...]]:
    """Loop, and runs with positions of even age, or without repeats."""
    loop = streams.of(loop_in)
    if loop is None or streams.of(batches_in) is not None or streams.of(clock_in) is not None:
        return None, runs  # a grid of stamps without repeated positions is a coarse clock's
    held = [r.touch for r in runs]
    even = undo_sample_hold(held, 1 / loop.value)
    if even is not None and ages_remain(held, even, 1 / loop.value):
        even = None  # another beat was taken for theirs
    shown = even or [first_of_repeats(touch) for touch in held]
    repaired = tuple(replace(r, touch=touch) for r, touch in zip(runs, shown, strict=True))
    return of_the_bus(replace(loop, undone=even is not None), streams), repaired


def of_the_bus(loop: StreamEffect, streams: Streams) -> StreamEffect:
    """The loop, as polls if its interval is that of a USB bus and positions do not repeat while the stylus moves."""
    period_s = 1 / loop.value
    repeat = _share_of_repeats(streams.touches, streams.step_mm)
    if repeat > FEW_REPEATS or not any(abs(period_s / bus_s - 1) < BUS_CLOCK for bus_s in BUS_S):
        return loop
    ci95_s = (1 / loop.ci95[1], 1 / loop.ci95[0])
    named = replace(
        loop, effect=PollGrid.id, parameter="period_s", value=period_s, ci95=ci95_s, where=message("every stamp")
    )
    return replace(named, rivals=(SampleHold.id,))


def loop_in(streams: Streams) -> StreamEffect | None:
    """Loop, unless by a deadband, polls or chords between scans."""
    other = streams.of(deadband_in) is not None or streams.of(polls_in) is not None
    other |= streams.of(reports_a_scan_in) > 1
    return None if other else hold(streams.touches, streams.step_mm)


def hold(touches: list[TouchTrace], step_mm: float = 0.0) -> StreamEffect | None:
    """Loop: even stamps, positions that repeat or are of uneven age. step_mm: of the coordinates."""
    intervals = np.concatenate([np.diff(t.t_s) for t in touches])
    period_s = float(np.median(intervals))
    if period_s <= 0:
        return None
    whole = np.maximum(np.round(intervals / period_s), 1)
    off_s = np.abs(intervals - period_s * whole)
    regular = off_s < REGULAR * period_s
    even = float(np.mean(regular)) >= MOST and float(np.median(off_s)) < max(MEDIAN * period_s, ARRIVAL_S)
    share = _share_of_repeats(touches, step_mm)
    age_s = uneven_age_s(touches, step_mm)
    if share <= FEW_REPEATS and age_s > UNEVEN_AGE * period_s:
        age_s = _age_without_ripple_s(touches, step_mm, age_s)
    if not even or not (share > FEW_REPEATS or age_s > UNEVEN_AGE * period_s):
        return None
    period_s = float(np.sum(intervals[regular]) / np.sum(whole[regular]))
    spread = float(np.std(intervals[regular] / whole[regular])) / math.sqrt(intervals.size)
    rate = 1 / period_s
    reach = max(1.96 * spread * rate**2, 1e-4 * rate)
    what = f"{100 * share:.0f} % of positions repeat the one before"
    if share <= FEW_REPEATS:
        what = f"the age of their positions varies by {1e3 * age_s:.1f} ms"
    return StreamEffect(
        SampleHold.id,
        "rate_hz",
        rate,
        (rate - reach, rate + reach),
        message("every tick of the host's loop"),
        f"stamps lie {1e3 * period_s:.2f} ms apart and {what}",
        max(share, age_s / period_s),
    )


def _share_of_repeats(touches: list[TouchTrace], step_mm: float) -> float:
    """Share of repeats in runs that advance by more than the resolution an event."""
    advance = [float(np.median(np.hypot(np.diff(t.x_mm), np.diff(t.y_mm)))) for t in touches]
    informative = [repeats(t) for t, each_mm in zip(touches, advance, strict=True) if each_mm >= STEPS * step_mm]
    # Where the loop is faster than the touch most events repeat, and none advances by the usual step.
    informative = informative or [repeats(t) for t, each_mm in zip(touches, advance, strict=True) if each_mm == 0]
    return float(np.mean(np.concatenate(informative))) if informative else 0.0


def _age_without_ripple_s(touches: list[TouchTrace], step_mm: float, age_s: float) -> float:
    """Scatter of ages without a panel's ripple."""
    ripple = lattice_of([(t.t_s, np.column_stack([t.x_mm, t.y_mm])) for t in touches])
    if ripple is None:
        return age_s
    even = [_at(t, ripple.undone_mm(np.column_stack([t.x_mm, t.y_mm]))) for t in touches]
    return uneven_age_s(even, step_mm)


def _at(touch: TouchTrace, xy_mm: np.ndarray) -> TouchTrace:
    return TouchTrace(touch.t_s, xy_mm[:, 0], xy_mm[:, 1], touch.contact_id, gaps_s=touch.gaps_s)
