"""Detector of contact losses filled with straight lines."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from draglag.gap.streams.interpolated import reports_a_scan_in
from draglag.gap.streams.stamps import WHOLE, StreamEffect, Streams
from draglag.messages import message
from draglag.recording import FloatArray, Run, TouchTrace
from draglag.simulation.effects.loss_of_contact import LossOfContact
from draglag.simulation.effects.sample_hold.stream import loop_in

LEAST_EVENTS = 60  # of a run
AROUND = 61  # events over which the usual bend is averaged
SMOOTH, SPEEDS = 7, 24  # events, and speeds of a session, over which a bend is averaged
LARGE_MM2 = 1e6  # where nothing is known
QUANTILE, NEIGHBOURS = 0.3, 5  # of the events at a speed, more than any fills; speeds that may be one
BY_CHANCE = 0.01  # stretches in a session that chance may make
# Times the variance of rounding (or the square of a line's largest bend) that bends must have, all through a run but
# for a share of its events (%).
INFORMATIVE, LEAST_USUAL = 4.0, 10.0
UNEVEN = 0.5  # of a frame that an interval may differ from it by
INDEPENDENT = 0.8  # of bends; neighbours share two events
OF_BEND = 0.02  # of the usual bend at a speed: fills have none. Three in a row by chance: one in 1e10 events. Derived
DECIMALS_MM = 2e-4  # largest bend of a line in coordinates of four decimals. Derived
LEAST_STEPS = 0.5  # of whole coordinates from event to event of a line: with fewer, most positions stand still


def detect(streams: Streams, runs: tuple[Run, ...]) -> tuple[StreamEffect | None, tuple[Run, ...]]:
    """Filled contact losses, and runs without the filling; none where every scan is followed by a line."""
    if streams.of(reports_a_scan_in) > 1:
        return None, runs
    return filled_losses(runs, streams.of(loop_in) is not None, streams.steps_mm)


def filled_losses(
    runs: tuple[Run, ...], uneven_ages: bool, steps_mm: tuple[float, float] = (0.0, 0.0)
) -> tuple[StreamEffect | None, tuple[Run, ...]]:
    """Filled contact losses: straight, evenly spaced stretches that the noise forbids.

    uneven_ages: spacing is no evidence. steps_mm: of quantised x and y, whose lines bend.
    """
    # Drivers fill evenly in time, or by count of events, whose stamps jitter.
    found = [_filled(runs, uneven_ages, steps_mm, by_count) for by_count in (False, True)]
    effect, repaired = max(found, key=lambda one: 0.0 if one[0] is None else one[0].value)
    return effect, repaired


def _filled(
    runs: tuple[Run, ...], uneven_ages: bool, steps_mm: tuple[float, float], by_count: bool
) -> tuple[StreamEffect | None, tuple[Run, ...]]:
    """With fills even by count of events, or in time."""
    least = 4 if uneven_ages else 3
    n_events = sum(run.touch.t_s.size for run in runs)
    length_s: list[float] = []
    total_s = 0.0
    out = []
    touches = [replace(run.touch, t_s=_by_count(run.touch.t_s)) if by_count else run.touch for run in runs]
    usual_bend = _usual_at_speed(touches)
    for index, run in enumerate(runs):
        out.append(run)
        t = run.touch.t_s
        if t.size < LEAST_EVENTS:
            continue
        straight = _lines(touches[index], uneven_ages, np.array(steps_mm), usual_bend.get(index), n_events)
        if straight is None:
            continue
        total_s += float(t[-1] - t[0])
        fills = _long_enough(_stretches(straight, least), run.touch, max(steps_mm))
        length_s += [float(t[end + 1] - t[start]) for start, end in fills]
        if fills:
            out[-1] = replace(run, touch=_without(run.touch, fills))
    count = len(length_s)
    if count < 4:
        return None, runs
    touching_s = max(total_s - sum(length_s), 1.0)  # contact is lost while there is contact
    per_min = 60 * count / touching_s
    reach = 1.96 * math.sqrt(count) * 60 / touching_s
    ordered_s = np.sort(length_s)
    ranks = np.clip(np.round(0.5 * (count - 1) + np.array([-0.98, 0.0, 0.98]) * math.sqrt(count)), 0, count - 1)
    low_s, usual_s, high_s = (float(ordered_s[int(rank)]) for rank in ranks)
    effect = StreamEffect(
        LossOfContact.id,
        "losses_per_min",
        per_min,
        (per_min - reach, per_min + reach),
        message("straight lines in the trace"),
        f"{count} straight fills of {1e3 * usual_s:.0f} ms (median)",
        count / max(len(runs), 1),
        also=(("duration_s", usual_s, (low_s, high_s)),),
    )
    return effect, tuple(out)


def _by_count(t_s: FloatArray) -> FloatArray:
    """Times (n,) of whole frames."""
    if t_s.size < LEAST_EVENTS:
        return t_s
    frame_s = float(np.median(np.diff(t_s)))
    frames = np.maximum(np.round(np.diff(t_s) / max(frame_s, 1e-6)), 1)
    return np.asarray(t_s[0] + frame_s * np.append(0.0, np.cumsum(frames)))


def _long_enough(
    stretches: Iterable[tuple[int, int]], touch: TouchTrace, resolution_mm: float
) -> list[tuple[int, int]]:
    """Stretches that cross enough whole coordinates."""
    x, y = touch.x_mm, touch.y_mm
    return [
        (start, end)
        for start, end in stretches
        if not np.hypot(x[end + 1] - x[start], y[end + 1] - y[start]) < LEAST_STEPS * resolution_mm * (end + 1 - start)
    ]


def _without(touch: TouchTrace, fills: Iterable[tuple[int, int]]) -> TouchTrace:
    """The trace without events inside of the fills."""
    keep = np.ones(touch.t_s.size, bool)
    for start, end in fills:
        keep[start + 1 : end + 1] = False
    ids = touch.contact_id[keep] if touch.contact_id.size == keep.size else touch.contact_id
    return TouchTrace(touch.t_s[keep], touch.x_mm[keep], touch.y_mm[keep], ids, gaps_s=touch.gaps_s)


def _lines(
    touch: TouchTrace, uneven_ages: bool, steps_mm: FloatArray, usual_bend: FloatArray | None, n_events: int
) -> np.ndarray | None:
    """Inner events (n − 2,) on lines that noise forbids; None where rounding alone makes lines."""
    if usual_bend is None:
        return None
    off, straight = _straight(touch, usual_bend, uneven_ages)
    if not steps_mm.all():
        return straight
    even = _even(touch.t_s)
    rounding_mm2 = steps_mm**2 / 8  # of a middle less its neighbours' mean, 1.5 times one coordinate's
    usual_mm2 = _usual_around(off, even, usual_bend, rounding_mm2)
    exact: np.ndarray = straight & _between_steps(touch, steps_mm)
    if (np.percentile(usual_mm2, LEAST_USUAL, axis=1) < INFORMATIVE * rounding_mm2).any():
        return exact if exact.any() else None  # where a slow path stays on one step, anything whole is a line
    return exact if uneven_ages else exact | _likelier_lines(off, usual_mm2, even, rounding_mm2, n_events)


def _between_steps(touch: TouchTrace, steps_mm: FloatArray) -> np.ndarray:
    """Whether inner events (n − 2,) lie between whole steps of the one before: filled after rounding."""
    steps = np.diff(np.column_stack([touch.x_mm, touch.y_mm]), axis=0)[:-1] / steps_mm
    return np.asarray((np.abs(steps - np.round(steps)) > WHOLE).any(axis=1))


def _straight(touch: TouchTrace, usual_mm2: FloatArray, uneven_ages: bool) -> tuple[FloatArray, np.ndarray]:
    """Distance of inner events from the line between their neighbours, (2, n − 2); whether none, where one is usual."""
    t, x, y = touch.t_s, touch.x_mm, touch.y_mm
    share = (t[1:-1] - t[:-2]) / np.maximum(t[2:] - t[:-2], 1e-9)
    off = np.array([v[1:-1] - v[:-2] - share * (v[2:] - v[:-2]) for v in (x, y)])
    bend = np.hypot(*off)
    if uneven_ages:
        # Positions of uneven age lie unevenly along the line, but on it.
        chord = np.hypot(x[2:] - x[:-2], y[2:] - y[:-2])
        bend = np.abs(off[0] * (y[2:] - y[:-2]) - off[1] * (x[2:] - x[:-2])) / np.maximum(chord, 1e-9)
    moving = np.hypot(np.diff(x), np.diff(y))[1:] > 0
    usual_mm = np.sqrt(2 * usual_mm2)
    limit_mm = OF_BEND * usual_mm + DECIMALS_MM
    shows = usual_mm**2 > INFORMATIVE * limit_mm**2
    return off, (bend < limit_mm) & shows & moving


def _usual_around(
    off_mm: FloatArray, even: FloatArray, at_speed_mm2: FloatArray, rounding_mm2: FloatArray
) -> FloatArray:
    """Mean square bend (2, n) mm² around each inner event."""
    from scipy.ndimage import uniform_filter1d

    of_even = uniform_filter1d(off_mm**2 * even, AROUND, axis=1)
    usual_mm2 = np.maximum(of_even / np.maximum(uniform_filter1d(even, AROUND), 1 / AROUND), 1e-12)
    return np.asarray(np.minimum(usual_mm2, np.maximum(at_speed_mm2, rounding_mm2[:, None])))


def _stretches(straight: np.ndarray, least: int) -> list[tuple[int, int]]:
    """Bounds of at least ``least`` True values; end excluded."""
    change = np.diff(straight.astype(np.int8), prepend=0, append=0)
    ends = zip(np.flatnonzero(change > 0).tolist(), np.flatnonzero(change < 0).tolist(), strict=True)
    return [(begin, end) for begin, end in ends if end - begin >= least]


def _usual_at_speed(touches: list[TouchTrace]) -> dict[int, FloatArray]:
    """By run, mean square bend (n,) mm² usual at each inner event's speed: filters may make lines at low speed, too."""
    from scipy.ndimage import minimum_filter1d, uniform_filter1d

    bends, speeds = {}, {}
    for index, touch in enumerate(touches):
        t, x, y = touch.t_s, touch.x_mm, touch.y_mm
        if t.size < LEAST_EVENTS:
            continue
        share = (t[1:-1] - t[:-2]) / np.maximum(t[2:] - t[:-2], 1e-9)
        even = _even(t)
        square = sum((v[1:-1] - v[:-2] - share * (v[2:] - v[:-2])) ** 2 for v in (x, y)) / 2
        weight = uniform_filter1d(even, SMOOTH)
        mean = uniform_filter1d(square * even, SMOOTH) / np.maximum(weight, 1 / SMOOTH)
        bends[index] = np.where(weight > 0.5, mean, np.nan)
        length = uniform_filter1d(np.hypot(np.diff(x), np.diff(y)), SMOOTH)
        speeds[index] = length[1:] / np.maximum(uniform_filter1d(np.diff(t), SMOOTH)[1:], 1e-9)
    if not bends:
        return {}
    all_speeds, all_bends = np.concatenate(list(speeds.values())), np.concatenate(list(bends.values()))
    limits = np.quantile(all_speeds, np.linspace(0, 1, SPEEDS + 1)[1:-1])
    known = ~np.isnan(all_bends)
    of_speed, bends_known = np.digitize(all_speeds[known], limits), all_bends[known]
    ends = np.cumsum(np.bincount(of_speed, minlength=SPEEDS))
    by_speed = np.split(bends_known[np.argsort(of_speed, kind="stable")], ends[:-1])
    level = np.array([np.quantile(np.append(own, LARGE_MM2), QUANTILE) for own in by_speed])
    level = minimum_filter1d(level, NEIGHBOURS)
    return {index: level[np.digitize(speed, limits)] for index, speed in speeds.items()}


def _even(t_s: np.ndarray) -> np.ndarray:
    """1 at inner events (n,) a frame from both neighbours, else 0."""
    frame_s = float(np.median(np.diff(t_s)))
    if frame_s <= 0:
        return np.zeros(max(t_s.size - 2, 0))
    frames = np.diff(t_s) / frame_s
    return np.asarray((np.abs(np.array([frames[:-1], frames[1:]]) - 1) < UNEVEN).all(axis=0), float)


def _likelier_lines(
    off_mm: np.ndarray, usual_mm2: np.ndarray, even: np.ndarray, rounding_mm2: FloatArray, n_events: int
) -> np.ndarray:
    """Events (n,) in stretches that rounded lines fit better."""
    rounding = rounding_mm2[:, None]
    gain = (0.5 * (np.log(usual_mm2 / rounding) - off_mm**2 * (1 / rounding - 1 / usual_mm2))).sum(axis=0)
    gain *= INDEPENDENT * even
    enough = np.log(n_events / BY_CHANCE)
    lines, more, begun = np.zeros(gain.size, bool), gain.tolist(), 0
    for start in np.flatnonzero(gain > 0).tolist():
        if start < begun:
            continue
        total = top = 0.0
        end = k = start
        while k < len(more) and (total := total + more[k]) > 0.0 and total >= top - enough:
            if total > top:
                top, end = total, k
            k += 1
        if top > enough:
            lines[start : end + 1] = True
        begun = k + 1
    return lines
