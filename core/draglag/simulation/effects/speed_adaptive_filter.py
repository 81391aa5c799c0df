"""The digitiser or the host smooths less the faster the stylus moves: the 1 euro filter."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Confounder, Effect, Parameter, TouchEvents, each_contact

BETA_PER_MM = 0.02
DERIVATIVE_HZ = 1.0  # cut-off of the low-pass on the velocity
SHORTEST_S = 1e-4  # between two events
CLOSE, STEPS = 1e-12, 50  # of Newton's method
STEEPEST = 0.3  # slope below which its steps are not to be trusted


@dataclass(frozen=True)
class SpeedAdaptiveFilter(Effect):
    """The digitiser or the host smooths less the faster the stylus moves: the 1 euro filter."""

    id: ClassVar[str] = "speed_adaptive_filter"
    title: ClassVar[str] = "speed-adaptive filter"
    meaning: ClassVar[str] = (
        "Positions pass a first-order low-pass whose cut-off rises with the speed, from this one at rest (1 euro "
        "filter)."
    )
    follows: ClassVar[str] = "speed"
    where: ClassVar[str] = "where the speed changes"
    separated_by: ClassVar[str] = "a chirp or step whose speed changes quickly"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("fmin_hz", "Hz", 0.1, 50.0, 1.0),
        Parameter("beta_per_mm", "1/mm", 0.0, 1.0, BETA_PER_MM),
    )
    confounded_with: ClassVar[tuple[Confounder, ...]] = (
        Confounder(
            "curve form",
            "at a constant speed its delay of 1 / (2 pi (fmin + beta v)) is a curve of latency over speed",
            "runs whose speed changes quickly: chirp and steps",
        ),
        Confounder(
            "smoothing_shrink",
            "both cut corners; at one speed the cut-off is one",
            "circles of the same radius at several speeds",
        ),
        Confounder(
            "lagging_law",
            "its cut-off follows a smoothed speed, which is an older one",
            "runs whose speed changes quickly: chirp and steps",
        ),
    )
    order: ClassVar[int] = -2
    settings: ClassVar[tuple[tuple[float, ...], ...]] = tuple(
        (fmin, beta) for fmin in (0.6, 1.0, 1.5) for beta in (0.01, 0.02, 0.05)
    )

    beta_per_mm: float = BETA_PER_MM

    def events(self, events: TouchEvents, rng: np.random.Generator) -> TouchEvents:
        return each_contact(events, lambda t_s, xy_mm: _smoothed(t_s, xy_mm, self.value, self.beta_per_mm))

    @classmethod
    def undo(cls, t_s: FloatArray, xy_mm: FloatArray, theta: tuple[float, ...]) -> FloatArray:
        """Exact, sample by sample; noise and rounding grow by the inverse of the filter's gain, 2 to 20 times."""
        fmin_hz, beta_per_mm = (*theta, BETA_PER_MM)[:2]
        shown, out = xy_mm.tolist(), xy_mm.copy()
        x, y = shown[0] if shown else (0.0, 0.0)
        vx = vy = 0.0
        times = 1.0
        for i, step_s in enumerate(np.maximum(np.diff(t_s), SHORTEST_S).tolist(), start=1):
            (was_x, was_y), (is_x, is_y) = shown[i - 1], shown[i]
            keep = _gain(DERIVATIVE_HZ, step_s)
            # Velocity at the filter's last output, and the innovation's part of it.
            rest = vx + keep * ((was_x - x) / step_s - vx), vy + keep * ((was_y - y) / step_s - vy)
            innovation = keep * (is_x - was_x) / step_s, keep * (is_y - was_y) / step_s
            times = _times_innovation(rest, innovation, (fmin_hz, beta_per_mm), step_s, times)
            x, y = was_x + times * (is_x - was_x), was_y + times * (is_y - was_y)
            vx, vy = rest[0] + times * innovation[0], rest[1] + times * innovation[1]
            out[i] = x, y
        return out


def _times_innovation(
    rest: tuple[float, float], innovation: tuple[float, float], theta: tuple[float, float], step_s: float, start: float
) -> float:
    """How many times the filter's last step its input lay ahead: the inverse of its gain at the velocity which that
    gives, rest + times * news, by Newton's method."""
    fmin_hz, beta_per_mm = theta
    times = start
    for _ in range(STEPS):
        vx, vy = rest[0] + times * innovation[0], rest[1] + times * innovation[1]
        speed = math.hypot(vx, vy)
        turn = 2 * math.pi * step_s * (fmin_hz + beta_per_mm * speed)
        rises = 2 * math.pi * step_s * beta_per_mm * (vx * innovation[0] + vy * innovation[1]) / max(speed, 1e-12)
        off = times - 1 - 1 / turn
        times = max(times - off / max(1 + rises / turn**2, STEEPEST), 1.0)
        if abs(off) < CLOSE * times:
            break
    return times


def _gain(cut_off_hz: float, step_s: float) -> float:
    """Gain of a first-order low-pass for the innovation of one step."""
    turn = 2 * math.pi * cut_off_hz * step_s
    return turn / (1 + turn)


def _smoothed(t_s: FloatArray, xy_mm: FloatArray, fmin_hz: float, beta_per_mm: float) -> FloatArray:
    """The filter as published: velocity from the raw positions, low-passed; its size opens the cut-off."""
    raw, out = xy_mm.tolist(), xy_mm.copy()
    x, y = raw[0]
    vx = vy = 0.0
    for i, step_s in enumerate(np.maximum(np.diff(t_s), SHORTEST_S).tolist(), start=1):
        keep = _gain(DERIVATIVE_HZ, step_s)
        vx += keep * ((raw[i][0] - raw[i - 1][0]) / step_s - vx)
        vy += keep * ((raw[i][1] - raw[i - 1][1]) / step_s - vy)
        gain = _gain(fmin_hz + beta_per_mm * math.hypot(vx, vy), step_s)
        x, y = x + gain * (raw[i][0] - x), y + gain * (raw[i][1] - y)
        out[i] = x, y
    return out
