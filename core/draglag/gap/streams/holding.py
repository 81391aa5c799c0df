"""Touch events that a host's loop held: stamps of its ticks, on positions that repeat or are of uneven age."""

from __future__ import annotations

import numpy as np

from draglag.gap.streams.stamps import FAST_MM_S, StreamEffect
from draglag.recording import TouchTrace
from draglag.simulation.effects.pitch_ripple.lattice import lattice_of

UNEVEN_AGE = 0.03  # of the interval between stamps
STILL = 0.7  # of the unevenness; where the ages were found, 0.1 to 0.5 of it stay
FEW = 0.5  # of all coordinates that may differ where they are whole steps
STEPS = 3.0  # of its coordinates that a run advances by from event to event, where a repeat means something


def resolution_mm(touches: list[TouchTrace]) -> float:
    """Step of coordinates that are whole steps of the panel's or screen's, mm; 0 where they are not."""
    steps = []
    fresh = [np.append(True, ~_repeats(t)) for t in touches]  # what a host holds is no step
    for axis in ("x_mm", "y_mm"):
        values = np.concatenate([getattr(t, axis)[keep] for t, keep in zip(touches, fresh, strict=True)])
        unique = np.unique(np.round(values, 6))
        if unique.size < 2 or unique.size > FEW * values.size:
            return 0.0
        apart = np.diff(unique)
        steps.append(float(np.median(apart[apart > 1e-5])) if np.any(apart > 1e-5) else 0.0)
    return max(steps)


def _repeats(touch: TouchTrace) -> np.ndarray:
    return np.asarray((np.diff(touch.x_mm) == 0) & (np.diff(touch.y_mm) == 0))


def hold(touches: list[TouchTrace], step_mm: float = 0.0) -> StreamEffect | None:
    """A host loop that writes the last event at each tick: even stamps, and positions that repeat or advance unevenly.

    A loop faster than the touch repeats positions; a slower one skips events, now one, now two, so the path advances
    unevenly at even stamps. step_mm: of the coordinates; a slow drag repeats coarse ones by itself.
    """
    intervals = np.concatenate([np.diff(t.t_s) for t in touches])
    period_s = float(np.median(intervals))
    if period_s <= 0:
        return None
    whole = np.maximum(np.round(intervals / period_s), 1)
    regular = np.abs(intervals - period_s * whole) < 0.015 * period_s
    advance = [float(np.median(np.hypot(np.diff(t.x_mm), np.diff(t.y_mm)))) for t in touches]
    told = [_repeats(t) for t, each_mm in zip(touches, advance, strict=True) if each_mm >= STEPS * step_mm]
    # Where the loop is faster than the touch most events repeat, and none advances by the usual step.
    told = told or [_repeats(t) for t, each_mm in zip(touches, advance, strict=True) if each_mm == 0]
    share = float(np.mean(np.concatenate(told))) if told else 0.0
    age_s = uneven_age_s(touches, step_mm)
    if share <= 0.02 and age_s > UNEVEN_AGE * period_s:
        # A ripple of the panel is uneven along the path as well, but by its place.
        ripple = lattice_of([(t.t_s, np.column_stack([t.x_mm, t.y_mm])) for t in touches])
        if ripple is not None:
            even = [_at(t, ripple.undone_mm(np.column_stack([t.x_mm, t.y_mm]))) for t in touches]
            age_s = uneven_age_s(even, step_mm)
    if float(np.mean(regular)) < 0.97 or not (share > 0.02 or age_s > UNEVEN_AGE * period_s):
        return None
    period_s = float(np.sum(intervals[regular]) / np.sum(whole[regular]))
    spread = float(np.std(intervals[regular] / whole[regular])) / np.sqrt(intervals.size)
    rate = 1 / period_s
    reach = max(1.96 * spread * rate**2, 1e-4 * rate)
    what = f"{100 * share:.0f} % of positions repeat the one before"
    if share <= 0.02:
        what = f"the age of their positions varies by {1e3 * age_s:.1f} ms"
    return StreamEffect(
        "sample_hold",
        "rate_hz",
        rate,
        (rate - reach, rate + reach),
        "every tick of the host's loop",
        f"stamps lie {1e3 * period_s:.2f} ms apart and {what}",
        max(share, age_s / period_s),
    )


def still_uneven(held: list[TouchTrace], even: list[TouchTrace], period_s: float) -> bool:
    """Whether positions of uneven age are hardly evener after their ages were undone."""
    before_s = uneven_age_s(held)
    return before_s > UNEVEN_AGE * period_s and uneven_age_s(even) > STILL * before_s


def _at(touch: TouchTrace, xy_mm: np.ndarray) -> TouchTrace:
    return TouchTrace(touch.t_s, xy_mm[:, 0], xy_mm[:, 1], touch.contact_id, gaps_s=touch.gaps_s)


def uneven_age_s(touches: list[TouchTrace], step_mm: float = 0.0) -> float:
    """By how much the age of the positions varies from stamp to stamp, s (median over runs fast enough to tell; or 0).

    A position of another age lies further along the path, not beside it: what third differences scatter by along the
    motion beyond what they do across it, less what the stamps themselves scatter by.
    """
    ages = []
    for touch in touches:
        t_s, xy_mm = touch.t_s, np.column_stack([touch.x_mm, touch.y_mm])
        frame_s = float(np.median(np.diff(t_s)))
        third = xy_mm[3:] - 3 * xy_mm[2:-1] + 3 * xy_mm[1:-2] - xy_mm[:-3]
        chord, span_s = xy_mm[3:] - xy_mm[:-3], t_s[3:] - t_s[:-3]
        length = np.hypot(chord[:, 0], chord[:, 1])
        whole = (np.abs(span_s - 3 * frame_s) < 0.3 * frame_s) & (length > 0)
        if np.count_nonzero(whole) < 200:
            continue
        speed = float(np.median(length[whole] / span_s[whole]))
        if speed < FAST_MM_S:
            continue
        ahead = chord[whole] / length[whole, None]
        along = np.sum(third[whole] * ahead, axis=1)
        across = third[whole, 0] * ahead[:, 1] - third[whole, 1] * ahead[:, 0]
        # Where the motion turns, a latency that depends on direction jumps by itself.
        straight = np.abs(ahead[:, 1]) > 0.4
        along, across = along[straight], across[straight]
        # 1 + 9 + 9 + 1: what third differences make of the variance of single events.
        variance_s2 = (_calm_variance(along) - _calm_variance(across)) / 20 / speed**2
        variance_s2 -= step_mm**2 / 12 / speed**2  # the coordinate that hardly changes is rounded alike
        stamps_s2 = 0.5 * _calm_variance(np.diff(t_s)[np.abs(np.diff(t_s) - frame_s) < 0.3 * frame_s])
        ages.append(float(np.sqrt(max(variance_s2 - stamps_s2, 0.0))))
    return float(np.median(ages)) if ages else 0.0


def _calm_variance(values: np.ndarray) -> float:
    """Mean square about the median, far values brought in to six robust standard deviations."""
    off = values - np.median(values)
    far = 6 * 1.4826 * float(np.median(np.abs(off)))
    return float(np.mean(np.clip(off, -far, far) ** 2))


def first_of_repeats(touch: TouchTrace) -> TouchTrace:
    keep = np.append(True, ~_repeats(touch))
    ids = touch.contact_id[keep] if touch.contact_id.size == keep.size else touch.contact_id
    return TouchTrace(touch.t_s[keep], touch.x_mm[keep], touch.y_mm[keep], ids, gaps_s=touch.gaps_s)
