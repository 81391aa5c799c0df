"""Detector of a deadband: no repeated position lies a width behind the stylus, and no step is shorter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import ndtr

from draglag.gap.streams.stamps import (
    FINEST_MM,
    OF_STEPS,
    StreamEffect,
    Streams,
    first_of_repeats,
    nothing_repeats,
    stood,
    with_unchanged,
)
from draglag.recording import FloatArray, Run, TouchTrace
from draglag.simulation.effects.deadband import JUMP, Deadband

NARROWEST_MM, WIDEST_MM = 0.05, 1.5  # half of the former is 0.6 ms at 45 mm/s
OFF_PATH_MM = (0.02, 0.04, 0.08, 0.16)  # by how much a stylus may lie off the straight way between two jumps
ROUNDED = 0.41  # standard deviation of a difference of two rounded coordinates, in steps
UNSURE = 0.5  # of a step of whole coordinates: rounding is no normal scatter
P_OUTLIER = 1e-3  # share of events that may be anything
MIN_LOG_RATIO = 10.0  # nats
SURELY = 4.0  # roundings, by which a step is shorter for certain
CERTAIN = 6.0  # standard deviations: further, a normal scatter changes nothing (1e-9)
NARROW = 1 / 32  # of the scatter, of a bin: 10 000 values are as likely as they are to 0.4 nats
WITHIN = 1.92  # nats below the best: not excluded at 95 %
WIDTHS = 160


def detect(streams: Streams, runs: tuple[Run, ...]) -> tuple[StreamEffect | None, tuple[Run, ...]]:
    """Deadband, and runs without repeated positions."""
    stood = streams.of(deadband_in)
    return stood, runs if stood is None else tuple(replace(r, touch=first_of_repeats(r.touch)) for r in runs)


def deadband_in(streams: Streams) -> StreamEffect | None:
    """Deadband in repeated positions, or in frames that the kernel leaves out because nothing changed."""
    touches = streams.touches
    if nothing_repeats(touches):
        touches = with_unchanged(touches)
    return deadband(touches, streams.step_mm)


def deadband(touches: Sequence[TouchTrace], step_mm: float = 0.0) -> StreamEffect | None:
    """Jump deadband, if likelier than random repeats. step_mm: of quantised coordinates."""
    runs = [_behind_and_steps(touch) for touch in touches]
    stood, moved = (np.concatenate(each) for each in zip(*runs, strict=True))
    moved = np.sort(moved)
    if not stood.size or not moved.size:
        return None
    at_random = sum(_of_share(behind.size, steps.size) for behind, steps in runs)
    rounding_mm = max(ROUNDED * step_mm, FINEST_MM)
    narrowest = max(OF_STEPS * step_mm, NARROWEST_MM)
    if narrowest >= WIDEST_MM:
        return None
    widths = np.geomspace(narrowest, WIDEST_MM, WIDTHS)
    widths = widths[_possible(widths, moved, rounding_mm, at_random)]
    if not widths.size:
        return None
    steps, nearer = Binned.of(moved, rounding_mm), [Binned.of(-stood, off) for off in OFF_PATH_MM]
    best = float(widths[int(np.argmax([_of_width(w, nearer, steps) for w in widths]))])
    near = np.linspace(max(0.94 * best, narrowest), 1.06 * best, WIDTHS)
    gains = np.array([_of_width(w, nearer, steps) for w in near])
    width = float(near[int(np.argmax(gains))])
    if gains.max() - at_random < MIN_LOG_RATIO or width <= 1.01 * narrowest:
        return None
    likely = near[gains > gains.max() - WITHIN]
    reach = float(near[1] - near[0]) + UNSURE * step_mm
    share = stood.size / (stood.size + moved.size)
    return StreamEffect(
        Deadband.id,
        "width_mm",
        width,
        (float(likely[0]) - reach, float(likely[-1]) + reach),
        "where the stylus is slow or turns",
        f"{100 * share:.0f} % of positions stand still until the stylus is {width:.2f} mm away; none is shorter",
        share,
        undone=False,  # a panel that scans more often than it reports shows a position up to a width old
        also=(("kind", JUMP, (JUMP, JUMP)),),
    )


def _behind_and_steps(touch: TouchTrace) -> tuple[FloatArray, FloatArray]:
    """Distances of repeated positions from the stylus; lengths of steps."""
    *_, behind_mm = stood(touch)
    step_mm = np.hypot(np.diff(touch.x_mm), np.diff(touch.y_mm))
    return behind_mm, step_mm[step_mm > 0]


def _of_share(stood: int, moved: int) -> float:
    """Log-likelihood of random repeats."""
    counts = np.array([stood, moved], float)
    shares = counts / max(float(counts.sum()), 1.0)
    return float(np.sum(counts * np.log(np.maximum(shares, 1e-12))))


def _possible(
    widths_mm: FloatArray, moved_mm: FloatArray, rounding_mm: float, at_random: float
) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Widths (k,) that may be likelier than random repeats."""
    shorter = np.searchsorted(moved_mm, widths_mm - SURELY * rounding_mm)
    return np.asarray(shorter * np.log(2 * P_OUTLIER) > at_random)


@dataclass(frozen=True)
class Binned:
    """Values of a normal scatter in bins that are narrow next to it: centres (k,), and how many are before each and in
    all, (k + 1,)."""

    centres: FloatArray
    before: FloatArray
    sd: float

    @classmethod
    def of(cls, values: FloatArray, sd: float) -> Binned:
        bins, counts = np.unique(np.round(values / (sd * NARROW)), return_counts=True)
        return cls(bins * sd * NARROW, np.cumsum(np.append(0.0, counts)), sd)

    def log_beyond(self, limit: float) -> float:
        """Log-likelihood that the values lie beyond a limit, outliers apart."""
        reach = CERTAIN * self.sd
        low, high = np.searchsorted(self.centres, [limit - reach, limit + reach])
        near = np.log((1 - P_OUTLIER) * ndtr((self.centres[low:high] - limit) / self.sd) + P_OUTLIER)
        return float(self.before[low] * np.log(P_OUTLIER) + near @ np.diff(self.before[low : high + 1]))


def _of_width(width_mm: float, nearer: Sequence[Binned], steps: Binned) -> float:
    """Log-likelihood. nearer: minus the distances of repeated positions, for each of ``OFF_PATH_MM``."""
    return steps.log_beyond(width_mm) + max(stood.log_beyond(-width_mm) for stood in nearer)
