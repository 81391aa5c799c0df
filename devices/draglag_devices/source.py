"""The protocol of every device (docs/sources.md)."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

from draglag.errors import DraglagError
from draglag.messages import message, phrase
from draglag.recording import AxisInfo, ClockBounds, FloatArray, IntArray, LaserTrace, Taps, TouchTrace
from draglag.touch_events.frames import Mapping2D


class DeviceError(DraglagError):
    """A device cannot be used; ``source``: its address."""

    def __init__(self, source: str, problem: str, remedy: str = "") -> None:
        self.source = source
        # A source may be no more than a scheme, "ethercat:", which brings the colon.
        where = source.removesuffix(":")
        super().__init__(message("{source}: {problem}", source=where, problem=phrase(problem)), remedy)


@dataclass(frozen=True)
class Notice:
    """A notice for operator and file; ``state``: "lost", "back" or empty."""

    t_s: float
    level: str  # "info" | "warning" | "error"
    text: str
    state: str = ""


@dataclass(frozen=True)
class SourceInfo:
    """An open source."""

    address: str
    role: str  # "touch" | "laser" | "walt"
    description: str
    clock: str  # which clock stamps the samples
    details: Mapping[str, str | float | int] = field(default_factory=dict)
    axes: tuple[AxisInfo, ...] = ()  # of a touchscreen


@dataclass(frozen=True)
class ContactChanges:
    """Beginnings and ends of contacts.

    Attributes:
        t_s: (n,) kernel stamps.
        contact_id: (n,) tracking ids.
        down: (n,) 1 began, 0 ended.
    """

    t_s: FloatArray
    contact_id: IntArray
    down: IntArray


@dataclass(frozen=True)
class Batch:
    """Result of one read; complete up to the host time ``until_s``.

    ``alive``: False while a lost device is searched for. A WALT's shocks are taps with ``registered_s`` NaN, which the
    session pairs with ``contacts``.
    """

    until_s: float
    touch: TouchTrace | None = None
    laser: LaserTrace | None = None
    taps: Taps | None = None
    clock: ClockBounds | None = None
    notices: tuple[Notice, ...] = ()
    alive: bool = True
    contacts: ContactChanges | None = None


class Source(Protocol):
    """A device, read from one thread."""

    address: str
    role: str

    def open(self) -> SourceInfo:
        """Claim the device. Raises DeviceError."""
        ...

    def read(self, timeout_s: float) -> Batch:
        """Samples, after at most ``timeout_s``. Raises DeviceError when lost for good."""
        ...

    def close(self) -> None:
        """Release the device. Never raises; twice does no harm."""
        ...


@runtime_checkable
class Paced(Protocol):
    """A source that says whether it runs in real time; others do."""

    realtime: bool
    """False where a reader may wait until samples are used (simulation, replay)."""


@runtime_checkable
class AcceptsPanel(Protocol):
    """A touchscreen that may need the panel's size."""

    def use_panel(self, width_mm: float, height_mm: float) -> None:
        """Take the size, for axes without units per mm; before ``open``."""
        ...


@runtime_checkable
class AcceptsCalibration(Protocol):
    """A touchscreen with a mapping to mm."""

    def use_calibration(self, mapping: Mapping2D, device: str, rms_mm: float) -> None:
        """Take the mapping, made on ``device``, with its residual; before ``open``."""
        ...


@runtime_checkable
class Concludes(Protocol):
    """A source with notices left when reading ends."""

    def final_notices(self) -> tuple[Notice, ...]:
        """Unreported notices; called once before ``close``, from the reading thread."""
        ...


@runtime_checkable
class Synchronises(Protocol):
    """A source that compares clocks on request."""

    def synchronise(self) -> threading.Event:
        """An event, set just before ``read`` returns a full comparison, if any. From any thread."""
        ...
