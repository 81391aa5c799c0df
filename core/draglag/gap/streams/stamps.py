"""How touch events are stamped: delivered in batches, rounded by a coarse clock, or missing."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from draglag.recording import FloatArray, TouchTrace

FAST_MM_S = 80.0  # slower, a position of another age does not lie elsewhere
CROWDED = 0.01  # of the stamps, that the one before is like: more than accidents make
EXACT = 2e-3  # of a tick: stamps are written to 1 µs; frames of the sample sessions jitter by 6e-3 of their interval
BEAT = 1.2  # of a tick: as far apart as rounding alone puts stamps
SLOW_FRAMES, SLOWEST_FRAMES = 61, 1000  # a panel's frame clock is even over the first, and a beat at most the second
LEAST_HOLE, LONGEST_HOLE = 6, 60  # frames from one event to the next, where others are lost
SHARE = 0.15  # of intervals or edges: below this it is an accident, not a habit


@dataclass(frozen=True)
class StreamEffect:
    """One effect seen in a stream: its size with a 95 % interval, where it shows, and the evidence in words.

    ``undone``: whether the repaired session is free of what it does to the edges. ``also``: its other numbers.
    """

    effect: str
    parameter: str
    value: float
    ci95: tuple[float, float]
    where: str
    evidence: str
    share: float
    undone: bool = True
    also: tuple[tuple[str, float, tuple[float, float]], ...] = ()

    @property
    def parameters(self) -> dict[str, tuple[float, tuple[float, float]]]:
        """Each number with its 95 % interval."""
        return {name: (value, ci95) for name, value, ci95 in ((self.parameter, self.value, self.ci95), *self.also)}


def share_interval(k: int, n: int, together: float = 1.0) -> tuple[float, float]:
    """95 % interval of a share. together: how many of the k come at once, for each of them."""
    p = k / n
    reach = 1.96 * np.sqrt(max(p * (1 - p), 1 / n) * together / n)
    return max(p - reach, 0.0), min(p + reach, 1.0)


def batches(touches: list[TouchTrace]) -> StreamEffect | None:
    """Frames delivered together: intervals of (nearly) nothing between long ones, in groups of one size."""
    sizes: list[int] = []
    for touch in touches:
        dt = np.diff(touch.t_s)
        typical = (touch.t_s[-1] - touch.t_s[0]) / max(dt.size, 1)
        together = dt < 0.25 * typical
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
        "frame_batching",
        "frames",
        float(size),
        (float(size), float(size)),
        "every frame",
        f"frames arrive {size} at a time in {100 * right:.0f} % of groups",
        right,
    )


def _exact_grid(touches: list[TouchTrace]) -> bool:
    """Whether stamps are multiples of one interval to a thousandth: a clock's ticks, not a digitiser's frames."""
    apart_s = np.concatenate([np.diff(touch.t_s) for touch in touches])
    tick_s = float(np.median(apart_s[apart_s > 0.25 * np.mean(apart_s)]))
    off_s = np.abs(apart_s - tick_s * np.round(apart_s / tick_s))
    return bool(np.mean(off_s < 1e-3 * tick_s) > 0.95)


def spread(touch: TouchTrace, size: int) -> TouchTrace:
    """Give each frame of a batch its own time: the last one keeps the stamp, the others lie a frame apart before it."""
    t = touch.t_s
    if t.size < 3:
        return touch
    frame_s = (t[-1] - t[0]) / (t.size - 1)
    last = np.append(np.diff(t) >= 0.25 * frame_s, True)
    ends = np.flatnonzero(last)
    which = np.searchsorted(ends, np.arange(t.size))
    spread = t[ends[which]] - (ends[which] - np.arange(t.size)) * frame_s
    return replace(touch, t_s=spread)


def evened(touch: TouchTrace, quantum_s: float) -> TouchTrace:
    """Stamps of an even frame clock through those of a coarse one: frames counted, the stamps' slow course kept."""
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


def counted_out(t_s: FloatArray, count: FloatArray, frame_s: float, quantum_s: float) -> FloatArray:
    """Times (n,) of counted frames of an even clock, the slow course of the stamps kept."""
    late = t_s - frame_s * count
    # Frames beat with the clock's ticks: the slow course is a mean over whole beats.
    off = abs(frame_s / quantum_s - round(frame_s / quantum_s))
    beats = np.arange(1, SLOW_FRAMES + 1) / max(off, 1 / SLOWEST_FRAMES)
    slow = _running_mean(late, round(beats[np.searchsorted(beats, SLOW_FRAMES)]))
    if np.ptp(np.quantile(late - slow, [0.01, 0.99])) > BEAT * quantum_s:
        slow = _running_mean(late, SLOW_FRAMES)  # not the beat alone: the frames' own rate wanders faster than that
    even = frame_s * count + slow
    return np.asarray(np.maximum.accumulate(even + 1e-9 * np.arange(t_s.size)))


def _running_mean(values: FloatArray, width: int) -> FloatArray:
    """Over so many of the values (n,); at the ends continued as it came."""
    width = min(width, values.size // 2)
    mean = np.convolve(values, np.full(width, 1 / width), mode="valid")
    return np.pad(mean, (width // 2, width - 1 - width // 2), mode="reflect", reflect_type="odd")


def coarse_clock(touches: list[TouchTrace]) -> StreamEffect | None:
    """Stamps that are multiples of one quantum while the intervals themselves vary: a coarse clock."""
    intervals = np.concatenate([np.diff(t.t_s) for t in touches])
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
    at_once = bool(np.mean(intervals < 1e-4) > CROWDED)
    if at_once:
        gaps = np.append(gaps, common[0])  # frames within one tick of the clock bear one stamp
    if gaps.size == 0:
        return None
    quantum_s = float(np.min(gaps))
    typical = float(np.mean(intervals))
    if quantum_s < 0.08 * typical or quantum_s > 2.5 * typical:
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
        "timestamp_quantisation",
        "quantum_s",
        quantum_s,
        (0.99 * quantum_s, 1.01 * quantum_s),
        "every stamp",
        f"{100 * share:.0f} % of intervals are multiples of {1e3 * quantum_s:.2f} ms",
        share,
        undone=not missing,  # which frame a stamp is of is then not sure
    )


def _reaches_further(touches: list[TouchTrace]) -> float:
    """How much of a longer interval the stylus uses to go further: 1 where frames are missing, 0 where stamps are
    coarse; median over the runs fast enough to tell, 0 without any."""
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


def drops(touches: list[TouchTrace]) -> StreamEffect | None:
    """Missing frames: intervals of two or more whole frames, far too many for losses of contact."""
    whole, short = [], 0
    for touch in touches:
        dt = np.diff(touch.t_s)
        frame_s = float(np.median(dt))
        if frame_s <= 0:
            continue
        apart = np.round(dt / frame_s)
        near = np.abs(dt - apart * frame_s) < 0.2 * frame_s
        # What comes at once after a pause was held back, not lost.
        short += int(np.count_nonzero(near & (apart == 0)))
        whole.append(apart[near & (apart >= 1) & (apart <= LONGEST_HOLE)].astype(np.int64))
    of_length = np.bincount(np.concatenate(whole or [np.zeros(0, np.int64)]), minlength=LONGEST_HOLE + 2)
    # Longer holes are the tail of the shorter ones up to the first length that is not there: then, contact was lost.
    of_length = of_length[: max(int(np.argmin(of_length[1:] > 0)) + 1, LEAST_HOLE + 1)]
    frames = np.arange(of_length.size)
    lost = int(of_length[2:] @ (frames[2:] - 1)) - short
    total = int(of_length @ frames)
    together = float(of_length[2:] @ (frames[2:] - 1) ** 2)
    share = lost / max(total, 1)
    mean_hole = lost / max(int(of_length[2:].sum()), 1)
    if share < 0.03:
        return None
    return StreamEffect(
        "frame_drop",
        "share",
        share,
        share_interval(lost, max(total, 1), together / lost),
        f"{mean_hole:.2g} frames at a time, all through" if mean_hole > 1.2 else "single frames, all through",
        f"{100 * share:.1f} % of frames are missing",
        share,
    )
