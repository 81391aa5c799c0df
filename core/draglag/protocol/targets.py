"""Targets (the paper, II.A and II.D), mm on the screen, y downwards."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from draglag.errors import DataError
from draglag.messages import message
from draglag.recording import Screen

FloatArray = NDArray[np.float64]
Pair = tuple[FloatArray, FloatArray]
Parameters = dict[str, float | int | str]

SIDEWAYS_PX_S = 15.0
"""Sideways speed of the target (the paper, II.D)."""

STEP_FRACTIONS = (0.05, 0.25, 0.50, 0.75, 0.95)
"""Share of a step's path covered at the beam (the paper, II.D)."""

MULTISINE_PERIOD_S = 40.96
MULTISINE_INDEX = (4, 7, 13, 19, 29, 37, 43, 59, 79, 109, 157)
MULTISINE_AMPLITUDE = (1.079, 0.776, 0.391, 0.225, 0.117, 0.082, 0.066, 0.051, 0.035, 0.028, 0.024)
MULTISINE_PHASE_RAD = (7.239, 0.506, 7.860, 8.184, 9.012, 6.141, 6.776, 6.265, 4.432, 2.672, 8.009)
"""Table 1 of the paper: frequency indices (of 2π/40.96 rad/s), amplitudes (unitless) and phases."""


class Target(Protocol):
    """A moving target. ``t_s``: since the start of the run, any shape, also of results."""

    @property
    def kind(self) -> str: ...

    @property
    def duration_s(self) -> float: ...

    def position_mm(self, t_s: ArrayLike) -> Pair:
        """(x, y)."""
        ...

    def velocity_mm_s(self, t_s: ArrayLike) -> Pair:
        """(vx, vy)."""
        ...

    def parameters(self) -> Parameters:
        """Flat numbers for ``target_from_parameters``."""
        ...


class _Parameters:
    kind: ClassVar[str]

    def parameters(self) -> Parameters:
        """Kind and fields."""
        return {"kind": self.kind, **asdict(self)}  # type: ignore[call-overload]


@dataclass(frozen=True)
class Circle(_Parameters):
    """A circle at constant angular speed about a centre that moves sideways.

    ``turn``: 1 clockwise on the screen, or −1; ``phase_rad``: angle at t = 0 from the x axis (−π/2: top).
    """

    kind: ClassVar[str] = "circle"
    centre_x_mm: float
    centre_y_mm: float
    radius_mm: float
    speed_mm_s: float
    duration_s: float = 40.0
    sideways_mm_s: float = 0.0
    phase_rad: float = -math.pi / 2
    turn: int = 1

    def position_mm(self, t_s: ArrayLike) -> Pair:
        t = np.asarray(t_s, float)
        angle = self.phase_rad + self.turn * self.speed_mm_s / self.radius_mm * t
        x = self.centre_x_mm + self.sideways_mm_s * t + self.radius_mm * np.cos(angle)
        return x, self.centre_y_mm + self.radius_mm * np.sin(angle)

    def velocity_mm_s(self, t_s: ArrayLike) -> Pair:
        t = np.asarray(t_s, float)
        angle = self.phase_rad + self.turn * self.speed_mm_s / self.radius_mm * t
        along = self.turn * self.speed_mm_s
        return self.sideways_mm_s - along * np.sin(angle), along * np.cos(angle)


@dataclass(frozen=True)
class Chirp(_Parameters):
    """A circle whose frequency rises linearly from ``start_hz`` to ``end_hz``."""

    kind: ClassVar[str] = "chirp"
    centre_x_mm: float
    centre_y_mm: float
    radius_mm: float
    duration_s: float = 80.0
    start_hz: float = 0.05
    end_hz: float = 1.0
    sideways_mm_s: float = 0.0
    phase_rad: float = -math.pi / 2
    turn: int = 1

    def frequency_hz(self, t_s: ArrayLike) -> FloatArray:
        """Revolutions per second at t."""
        return self.start_hz + (self.end_hz - self.start_hz) / self.duration_s * np.asarray(t_s, float)

    def _angle(self, t: FloatArray) -> FloatArray:
        turns = self.start_hz * t + (self.end_hz - self.start_hz) / (2 * self.duration_s) * t**2
        return self.phase_rad + self.turn * 2 * np.pi * turns

    def position_mm(self, t_s: ArrayLike) -> Pair:
        t = np.asarray(t_s, float)
        angle = self._angle(t)
        x = self.centre_x_mm + self.sideways_mm_s * t + self.radius_mm * np.cos(angle)
        return x, self.centre_y_mm + self.radius_mm * np.sin(angle)

    def velocity_mm_s(self, t_s: ArrayLike) -> Pair:
        t = np.asarray(t_s, float)
        angle = self._angle(t)
        along = self.turn * self.radius_mm * 2 * np.pi * self.frequency_hz(t)
        return self.sideways_mm_s - along * np.sin(angle), along * np.cos(angle)


@dataclass(frozen=True)
class MultiSine(_Parameters):
    """Eleven sines in y (Table 1), repeating every 40.96 s; ``scale_mm`` is one unit of amplitude."""

    kind: ClassVar[str] = "multisine"
    start_x_mm: float
    centre_y_mm: float
    scale_mm: float
    duration_s: float = 45.0
    sideways_mm_s: float = 0.0

    def _angles(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        omega = np.asarray(MULTISINE_INDEX) * 2 * np.pi / MULTISINE_PERIOD_S
        angle = t[..., None] * omega + np.asarray(MULTISINE_PHASE_RAD)
        return angle, omega, np.asarray(MULTISINE_AMPLITUDE)

    def position_mm(self, t_s: ArrayLike) -> Pair:
        t = np.asarray(t_s, float)
        angle, _, amplitude = self._angles(t)
        y = self.centre_y_mm + self.scale_mm * (np.sin(angle) @ amplitude)
        return self.start_x_mm + self.sideways_mm_s * t, y

    def velocity_mm_s(self, t_s: ArrayLike) -> Pair:
        t = np.asarray(t_s, float)
        angle, omega, amplitude = self._angles(t)
        return np.full(t.shape, self.sideways_mm_s), self.scale_mm * (np.cos(angle) @ (amplitude * omega))


@dataclass(frozen=True)
class Step(_Parameters):
    """Minimum-jerk steps of ``distance_mm`` across the beam y = slope · x + intercept, down and up.

    For each share f of ``STEP_FRACTIONS``, one down meets the beam after f of its path.
    """

    kind: ClassVar[str] = "step"
    start_x_mm: float
    beam_intercept_mm: float
    distance_mm: float
    beam_slope: float = 0.0
    duration_s: float = 40.0
    sideways_mm_s: float = 0.0
    move_s: float = 0.4
    rest_s: float = 0.6

    @property
    def cycle_s(self) -> float:
        """Time of ten steps."""
        return len(STEP_FRACTIONS) * 2 * (self.move_s + self.rest_s)

    def _height(self, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        start = -np.asarray(STEP_FRACTIONS) * self.distance_mm
        bottom = start + self.distance_mm
        moves = (start, bottom, bottom, start)  # where each of down, rest, up, rest begins …
        ends = (bottom, bottom, start, np.roll(start, -1))  # … and ends
        length = np.tile([self.move_s, self.rest_s, self.move_s, self.rest_s], len(STEP_FRACTIONS))
        begin = np.stack(moves, axis=1).ravel()
        end = np.stack(ends, axis=1).ravel()
        edges = np.concatenate(([0.0], np.cumsum(length)))
        within = np.mod(t, self.cycle_s)
        part = np.clip(np.searchsorted(edges, within, side="right") - 1, 0, len(length) - 1)
        u = (within - edges[part]) / length[part]
        span = end[part] - begin[part]
        height = begin[part] + span * minimum_jerk(u)
        return height, span * 30 * u**2 * (1 - u) ** 2 / length[part]

    def position_mm(self, t_s: ArrayLike) -> Pair:
        t = np.asarray(t_s, float)
        x = self.start_x_mm + self.sideways_mm_s * t
        return x, self.beam_intercept_mm + self.beam_slope * x + self._height(t)[0]

    def velocity_mm_s(self, t_s: ArrayLike) -> Pair:
        t = np.asarray(t_s, float)
        vy = self.beam_slope * self.sideways_mm_s + self._height(t)[1]
        return np.full(t.shape, self.sideways_mm_s), vy


@dataclass(frozen=True)
class Tap(_Parameters):
    """A spot to tap ``count`` times, ``interval_s`` apart."""

    kind: ClassVar[str] = "tap"
    x_mm: float
    y_mm: float
    count: int = 100
    interval_s: float = 0.8

    @property
    def duration_s(self) -> float:
        return self.count * self.interval_s

    def position_mm(self, t_s: ArrayLike) -> Pair:
        shape = np.shape(t_s)
        return np.full(shape, self.x_mm), np.full(shape, self.y_mm)

    def velocity_mm_s(self, t_s: ArrayLike) -> Pair:
        return np.zeros(np.shape(t_s)), np.zeros(np.shape(t_s))


_KINDS: dict[str, type[Circle] | type[Chirp] | type[MultiSine] | type[Step] | type[Tap]] = {
    cls.kind: cls for cls in (Circle, Chirp, MultiSine, Step, Tap)
}
KINDS = tuple(_KINDS)


def minimum_jerk(u: FloatArray) -> FloatArray:
    """Share of a minimum-jerk path after share u of its time."""
    return np.asarray(u**3 * (10 - 15 * u + 6 * u**2))


def target_from_parameters(kind: str, parameters: Mapping[str, float | int | str]) -> Target:
    """The target that ``parameters()`` described. Raises DataError on an unknown kind or odd numbers."""
    if kind not in _KINDS:
        raise DataError(
            message("unknown target kind '{kind}'", kind=kind), message("use one of {kinds}", kinds=", ".join(KINDS))
        )
    cls = _KINDS[kind]
    wanted = {f.name: f for f in fields(cls)}
    given = {k: v for k, v in parameters.items() if k != "kind"}
    for name in given:
        if name not in wanted:
            raise DataError(
                message("a {kind} target has no parameter '{name}'", kind=kind, name=name),
                message("known: {names}", names=", ".join(wanted)),
            )
    try:
        values = {
            k: int(v) if wanted[k].type in (int, "int") else float(v)  # annotations are strings here
            for k, v in given.items()
        }
        return cls(**values)  # type: ignore[arg-type]
    except (TypeError, ValueError) as error:
        raise DataError(
            message("parameters of a {kind} target are incomplete or not numbers: {error}", kind=kind, error=error)
        ) from error


def to_px(screen: Screen, x_mm: ArrayLike, y_mm: ArrayLike) -> Pair:
    """Millimetres (or mm/s) to pixels (or px/s)."""
    mm_x, mm_y = screen.mm_per_px
    return np.asarray(x_mm, float) / mm_x, np.asarray(y_mm, float) / mm_y


def check_on_screen(target: Target, screen: Screen, margin_mm: float = 0.0) -> None:
    """Raise DataError if the target comes within ``margin_mm`` of the edge."""
    t = np.linspace(0.0, target.duration_s, max(1000, int(target.duration_s * 200)))
    for name, p, size in zip("xy", target.position_mm(t), (screen.width_mm, screen.height_mm), strict=True):
        low, high = float(p.min()), float(p.max())
        if low < margin_mm - 1e-9 or high > size - margin_mm + 1e-9:
            raise DataError(
                message(
                    "the {kind} target leaves the screen: {name} runs from {low:.1f} to {high:.1f} mm, but {screen} "
                    "allows {from_mm:.1f} to {to_mm:.1f} mm",
                    kind=target.kind,
                    name=name,
                    low=low,
                    high=high,
                    screen=screen.name,
                    from_mm=margin_mm,
                    to_mm=size - margin_mm,
                ),
                "choose a smaller radius, a slower sideways speed or a shorter run"
                if name == "x"
                else "choose a smaller size",
            )
