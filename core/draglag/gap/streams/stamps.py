"""Effects detected in streams."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from draglag.latency.spectrum import events_of
from draglag.path.events import sample_interval_s
from draglag.recording import FloatArray, IntArray, Session, TouchTrace

FAST_MM_S = 80.0  # slower, a position of another age does not lie elsewhere. Derived: 8 ms are 0.6 mm
CROWDED = 0.01  # of the stamps, that the one before is like: more than accidents make. Judgement
BEAT = 1.2  # of a tick: as far apart as rounding alone puts stamps. Derived
# A panel's frame clock is even over the first, and a beat at most the second, in frames. Physical.
SLOW_FRAMES, SLOWEST_FRAMES = 61, 1000
FINEST_MM = 5e-4  # finer steps are those of a file's decimals. Physical
ROUNDED_MM = 1e-5  # coordinates that differ by less are alike but for arithmetic. Derived
SMALL = 4  # steps between two events at which it shows whether they are whole. Derived
WHOLE, SHARE_WHOLE = 0.1, 0.5  # of a step; of the distances, for fills may have any: by chance a fifth. Judgement
OF_STEPS = 2.5  # steps of whole coordinates, below which those alone make positions stand still. Derived
LONGEST_HOLD = 60  # frames without a change: more, and the stylus rests or is lost. Judgement
TURNING = 0.5  # of the usual speed: at the turns of strokes a steep law stalls and skips. Judgement
Found = TypeVar("Found")


@dataclass(frozen=True)
class StreamEffect:
    """Effect detected in a stream. undone: whether repair removes its influence on edges; also: other parameters."""

    effect: str
    parameter: str
    value: float
    ci95: tuple[float, float]
    where: str
    evidence: str
    share: float
    undone: bool = True
    also: tuple[tuple[str, float, tuple[float, float]], ...] = ()
    rivals: tuple[str, ...] = ()

    @property
    def parameters(self) -> dict[str, tuple[float, tuple[float, float]]]:
        return {name: (value, ci95) for name, value, ci95 in ((self.parameter, self.value, self.ci95), *self.also)}


def share_interval(k: int, n: int, together: float = 1.0) -> tuple[float, float]:
    """95 % interval of k / n. together: simultaneous events."""
    p = k / n
    reach = 1.96 * math.sqrt(max(p * (1 - p), 1 / n) * together / n)
    return max(p - reach, 0.0), min(p + reach, 1.0)


@dataclass(frozen=True)
class Streams:
    """Unrepaired streams. touches: with enough events; steps_mm: of quantised x and y, else 0."""

    session: Session
    touches: list[TouchTrace]
    steps_mm: tuple[float, float]
    _known: dict[Callable[..., Any], Any] = field(default_factory=dict, repr=False)

    @property
    def step_mm(self) -> float:
        """The coarser step."""
        return max(self.steps_mm)

    @property
    def unsent_mm(self) -> tuple[float, float]:
        """Steps of x and y where frames in which neither changed are not sent; else 0."""
        return self.steps_mm if nothing_repeats(self.touches) else (0.0, 0.0)

    def of(self, detect: Callable[[Streams], Found]) -> Found:
        """Result of a detector, cached."""
        if detect not in self._known:
            self._known[detect] = detect(self)
        found: Found = self._known[detect]
        return found


def counted_out(t_s: FloatArray, count: FloatArray, frame_s: float, quantum_s: float) -> FloatArray:
    """Times (n,) of frames on an even clock that follows the stamps slowly."""
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
    width = min(width, values.size // 2)
    mean = np.convolve(values, np.full(width, 1 / width), mode="valid")
    return np.pad(mean, (width // 2, width - 1 - width // 2), mode="reflect", reflect_type="odd")


def resolutions_mm(touches: list[TouchTrace]) -> tuple[float, float]:
    """Steps of x and y, which panels may have of different size; 0 if either is not quantised."""
    x, y = (_step_mm([getattr(t, axis) for t in touches]) for axis in ("x_mm", "y_mm"))
    return (x, y) if x and y else (0.0, 0.0)


def _step_mm(values_mm: list[FloatArray]) -> float:
    """The commonest distance between neighbouring values, if most events lie whole steps apart; else 0."""
    spacing = np.diff(np.unique(np.round(np.concatenate(values_mm), 6)))
    sizes, counts = np.unique(np.round(spacing[spacing > ROUNDED_MM] / ROUNDED_MM), return_counts=True)
    if not sizes.size:
        return 0.0
    commonest = ROUNDED_MM * float(sizes[np.argmax(counts)])
    step = float(np.median(spacing[np.abs(spacing - commonest) < WHOLE * commonest]))
    moved = np.abs(np.concatenate([np.diff(each) for each in values_mm])) / step
    moved = moved[(moved > WHOLE) & (moved < SMALL + 0.5)]
    whole = int(np.count_nonzero(np.abs(moved - np.round(moved)) < WHOLE))
    return step if step > FINEST_MM and whole > SHARE_WHOLE * moved.size else 0.0


def repeats(touch: TouchTrace) -> np.ndarray:
    """Whether each event repeats the position before, (n − 1,)."""
    return np.asarray((np.diff(touch.x_mm) == 0) & (np.diff(touch.y_mm) == 0))


def stood(touch: TouchTrace) -> tuple[IntArray, IntArray, FloatArray]:
    """Events (k,) that repeat the position before, the event that each repeats, and how far the stylus has gone
    meanwhile on a straight line to the next position, mm."""
    again = np.append(False, repeats(touch))
    fresh = np.flatnonzero(~again)
    events = np.flatnonzero(again[: fresh[-1]])  # nobody knows where the last ones went
    last = np.searchsorted(fresh, events, side="right") - 1
    begin, end = fresh[last], fresh[last + 1]
    share = (touch.t_s[events] - touch.t_s[begin]) / np.maximum(touch.t_s[end] - touch.t_s[begin], 1e-9)
    leap_mm = np.hypot(touch.x_mm[end] - touch.x_mm[begin], touch.y_mm[end] - touch.y_mm[begin])
    return events, begin, np.asarray(share * leap_mm)


def first_of_repeats(touch: TouchTrace) -> TouchTrace:
    """Events without repeated positions."""
    keep = np.append(True, ~repeats(touch))
    ids = touch.contact_id[keep] if touch.contact_id.size == keep.size else touch.contact_id
    return TouchTrace(touch.t_s[keep], touch.x_mm[keep], touch.y_mm[keep], ids, gaps_s=touch.gaps_s)


def nothing_repeats(touches: Sequence[TouchTrace]) -> bool:
    """Whether no position comes twice: a kernel sends no report in which nothing changed."""
    return not any(repeats(touch).any() for touch in touches)


def all_sent(
    t_s: FloatArray, x_mm: FloatArray, y_mm: FloatArray, frame_s: float, unsent_mm: tuple[float, float]
) -> np.ndarray:
    """Intervals (n − 1,) over which a coordinate goes so many steps a frame that each frame changes it."""
    if not all(unsent_mm):
        return np.ones(max(t_s.size - 1, 0), bool)
    steps = np.maximum(*(np.abs(np.diff(each)) / step for each, step in zip((x_mm, y_mm), unsent_mm, strict=True)))
    return np.asarray(steps >= OF_STEPS * np.maximum(np.diff(t_s) / frame_s, 1.0))


def with_unchanged(touches: Sequence[TouchTrace]) -> list[TouchTrace]:
    """Events with the frames between them that are missing, each at the position before.

    A slow run may miss most frames: their interval is that of the run that misses fewest.
    """
    frame_s = min(sample_interval_s(touch.t_s) for touch in touches)
    return [_filled(touch, frame_s) for touch in touches]


def _filled(touch: TouchTrace, frame_s: float) -> TouchTrace:
    slot = events_of(touch.t_s, np.column_stack([touch.x_mm, touch.y_mm]), frame_s).slot
    missing = np.diff(slot, append=slot[-1] + 1)
    held = np.where(missing <= LONGEST_HOLD, missing, 1)
    which = np.repeat(np.arange(slot.size), held)
    after = np.arange(which.size) - np.repeat(np.cumsum(held) - held, held)
    apart_s = np.diff(touch.t_s, append=touch.t_s[-1]) / missing
    return TouchTrace(touch.t_s[which] + after * apart_s[which], touch.x_mm[which], touch.y_mm[which])
