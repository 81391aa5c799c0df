"""The raw data of a session; times on the host's monotonic clock unless named ``device``, y downwards."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from draglag.shown import brief, table_html

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

PROTOCOLS = ("circle", "chirp", "multisine", "step", "free")
OUTCOMES = ("complete", "aborted", "device_lost", "failed")


def _floats() -> FloatArray:
    return np.empty(0)


def _ints() -> IntArray:
    return np.empty(0, np.int64)


def _no_gaps() -> FloatArray:
    return np.empty((0, 2))


@dataclass(frozen=True)
class Screen:
    """The panel under test: active area in mm, picture in pixels."""

    name: str
    width_mm: float
    height_mm: float
    width_px: int
    height_px: int

    @property
    def mm_per_px(self) -> tuple[float, float]:
        """Size of one pixel, (x, y)."""
        return self.width_mm / self.width_px, self.height_mm / self.height_px


@dataclass(frozen=True)
class Stylus:
    diameter_mm: float
    name: str = ""


@dataclass(frozen=True)
class Beam:
    """The laser beam as the operator measured it: y = slope · x + intercept_mm. Estimates fit it themselves."""

    slope: float
    intercept_mm: float


@dataclass(frozen=True)
class AxisInfo:
    """One axis as the kernel describes it (EVIOCGABS), device units; resolution per mm, 0 = unknown."""

    name: str
    minimum: int
    maximum: int
    resolution: int = 0
    fuzz: int = 0


@dataclass(frozen=True)
class TouchCalibration:
    """Touched targets and the affine fitted to them.

    Attributes:
        x_raw, y_raw: (n,) touches, device units. x_mm, y_mm: (n,) the targets.
        matrix: (2, 3) rows (xx, xy, x0_mm) and (yx, yy, y0_mm).
    """

    x_raw: FloatArray
    y_raw: FloatArray
    x_mm: FloatArray
    y_mm: FloatArray
    matrix: FloatArray
    device: str = ""
    made_utc: str = ""

    __repr__ = brief


@dataclass(frozen=True)
class TouchTrace:
    """Touch events (n,) of one contact at a time, in order of their kernel stamps.

    Attributes:
        contact_id: the kernel's tracking id, counted on after a reconnection; a change marks a new contact.
        x_raw, y_raw: device units, or empty.
        device_t_s: the digitiser's own stamps (MSC_TIMESTAMP), or empty.
        gaps_s: (k, 2) incomplete stretches. dropped: events known to be lost.
    """

    t_s: FloatArray
    x_mm: FloatArray
    y_mm: FloatArray
    contact_id: IntArray = field(default_factory=_ints)
    x_raw: FloatArray = field(default_factory=_floats)
    y_raw: FloatArray = field(default_factory=_floats)
    device_t_s: FloatArray = field(default_factory=_floats)
    gaps_s: FloatArray = field(default_factory=_no_gaps)
    dropped: int = 0
    axes: tuple[AxisInfo, ...] = ()

    __repr__ = brief


@dataclass(frozen=True)
class LaserTrace:
    """Edges (m,) of the laser sensor.

    Attributes:
        light: 1 = from here on the beam is on the sensor, 0 = it is dark.
        device_t_s: the sensor interface's own stamp, or empty.
        epoch: counts restarts of the device clock, or empty.
        gaps_s: (k, 2) incomplete stretches. missed: edges known to be missing.
    """

    t_s: FloatArray
    light: IntArray
    device_t_s: FloatArray = field(default_factory=_floats)
    epoch: IntArray = field(default_factory=_ints)
    gaps_s: FloatArray = field(default_factory=_no_gaps)
    missed: int = 0

    __repr__ = brief


@dataclass(frozen=True)
class ClockBounds:
    """A device clock seen from the host: ``device_s[k]`` happened between ``host_min_s[k]`` and ``host_max_s[k]``.

    One of them may be infinite. ``epoch[k]`` counts restarts of the device clock: epochs share no offset.
    """

    stream: str
    device_s: FloatArray
    host_min_s: FloatArray
    host_max_s: FloatArray
    epoch: IntArray = field(default_factory=_ints)

    __repr__ = brief


@dataclass(frozen=True)
class DisplayTrace:
    """Where the target was drawn, at each frame."""

    t_s: FloatArray
    x_mm: FloatArray
    y_mm: FloatArray
    missed: int = 0

    __repr__ = brief


@dataclass(frozen=True)
class LogEntry:
    t_s: float
    level: str  # "info" | "warning" | "error" | "note" (the operator's words)
    source: str
    text: str


@dataclass(frozen=True)
class Taps:
    """Taps timed by the WALT: physical contact against registered event.

    ``down``: (n,) 1 = touch, 0 = release; ``rejected``: reason → count of unused taps.
    """

    physical_s: FloatArray
    registered_s: FloatArray
    down: IntArray
    rejected: Mapping[str, int] = field(default_factory=dict)

    __repr__ = brief


@dataclass(frozen=True)
class Run:
    """One uninterrupted recording of one target."""

    id: str
    protocol: str
    start_s: float
    duration_s: float
    touch: TouchTrace
    laser: LaserTrace
    nominal_speed_mm_s: float | None = None
    radius_mm: float | None = None
    target: Mapping[str, float | int | str] = field(default_factory=dict)
    display: DisplayTrace | None = None
    sync: tuple[ClockBounds, ...] = ()
    log: tuple[LogEntry, ...] = ()
    outcome: str = "complete"
    seed: int | None = None

    __repr__ = brief


@dataclass(frozen=True)
class Session:
    """All runs, taps and clock comparisons of one screen on one occasion."""

    name: str
    screen: Screen
    stylus: Stylus
    runs: tuple[Run, ...]
    taps: Taps | None = None
    beam: Beam | None = None
    clocks: tuple[ClockBounds, ...] = ()
    started_utc: str = ""  # ISO 8601, the NeXus-like start of the session
    clock: str = "host CLOCK_MONOTONIC, seconds"
    notes: tuple[LogEntry, ...] = ()
    protocol_toml: str = ""
    seed: int | None = None
    devices: Mapping[str, str] = field(default_factory=dict)  # role → address and description
    details: Mapping[str, str] = field(default_factory=dict)  # participant, session, operator, free fields
    software: str = ""
    started_s: float | None = None  # what the host's clock said at started_utc
    calibration: TouchCalibration | None = None  # the one that positions were mapped with

    def run(self, run_id: str) -> Run:
        """The run of that id. Raises KeyError."""
        for run in self.runs:
            if run.id == run_id:
                return run
        raise KeyError(run_id)

    __repr__ = brief

    def _repr_html_(self) -> str:
        head = ["run", "protocol", "speed mm/s", "duration s", "touch events", "edges", "outcome"]
        rows = [
            (r.id, r.protocol, r.nominal_speed_mm_s, r.duration_s, len(r.touch.t_s), len(r.laser.t_s), r.outcome)
            for r in self.runs
        ]
        return table_html(f"Session {self.name} on {self.screen.name}", head, rows)


_Trace = TypeVar("_Trace", TouchTrace, LaserTrace, ClockBounds, Taps, DisplayTrace)


def concatenate(parts: Sequence[_Trace]) -> _Trace:
    """Traces of one stream joined: counts added, the rest of the first. Raises ValueError on an empty sequence."""
    if not parts:
        raise ValueError("nothing to concatenate")
    first = parts[0]
    joined: dict[str, Any] = {}
    for spec in fields(first):
        values = [getattr(part, spec.name) for part in parts]
        if isinstance(values[0], np.ndarray):
            joined[spec.name] = np.concatenate(values)
        elif isinstance(values[0], int):
            joined[spec.name] = sum(values)
        elif spec.name == "rejected":
            joined[spec.name] = {k: sum(v.get(k, 0) for v in values) for v0 in values for k in v0}
    return replace(first, **joined)


def empty_touch() -> TouchTrace:
    return TouchTrace(_floats(), _floats(), _floats())


def empty_laser() -> LaserTrace:
    return LaserTrace(_floats(), _ints())
