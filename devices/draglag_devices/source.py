"""The one small protocol every device speaks: open, read, close."""

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
    """A device cannot be used. Names the source (its address), the problem and the remedy."""

    def __init__(self, source: str, problem: str, remedy: str = "") -> None:
        self.source = source
        # A source may be no more than a scheme, "ethercat:", which brings the colon.
        where = source.removesuffix(":")
        super().__init__(message("{source}: {problem}", source=where, problem=phrase(problem)), remedy)


@dataclass(frozen=True)
class Notice:
    """Something the operator should read and the file should keep: loss, restart, unplugging, return.

    ``state``: "lost" and "back" where the device went or came back, else empty.
    """

    t_s: float
    level: str  # "info" | "warning" | "error"
    text: str
    state: str = ""


@dataclass(frozen=True)
class SourceInfo:
    """What a source is, known once it is open."""

    address: str
    role: str  # "touch" | "laser" | "walt"
    description: str
    clock: str  # which clock stamps the samples
    details: Mapping[str, str | float | int] = field(default_factory=dict)
    axes: tuple[AxisInfo, ...] = ()  # of a touchscreen


@dataclass(frozen=True)
class ContactChanges:
    """When the kernel reported that a contact began or ended.

    Attributes:
        t_s: (n,) kernel stamp.
        contact_id: (n,) the kernel's tracking id.
        down: (n,) 1 = began, 0 = ended.
    """

    t_s: FloatArray
    contact_id: IntArray
    down: IntArray


@dataclass(frozen=True)
class Batch:
    """What one read returned. ``until_s``: all that happened before this host time has been reported.

    A source fills only the fields of its role; ``None`` means nothing came. ``alive`` is False while the
    device is lost and being recovered (a notice says why). A WALT reports shocks as taps whose
    ``registered_s`` is NaN; the session pairs them with the touch source's ``contacts``.
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
    """A device that can be opened, read from one thread, and closed (twice without harm)."""

    address: str
    role: str

    def open(self) -> SourceInfo:
        """Claim the device. Raises DeviceError with a remedy."""
        ...

    def read(self, timeout_s: float) -> Batch:
        """Wait at most ``timeout_s`` for samples. Raises DeviceError when the device is lost for good."""
        ...

    def close(self) -> None:
        """Release the device. Never raises."""
        ...


@runtime_checkable
class Paced(Protocol):
    """A source that says whether its time is real; without it, it is."""

    realtime: bool
    """False where a reader may wait for whoever takes its samples (simulation, replay)."""


@runtime_checkable
class AcceptsPanel(Protocol):
    """A touchscreen that takes the panel's size: one that reports no units per mm has no other way to know it."""

    def use_panel(self, width_mm: float, height_mm: float) -> None:
        """The size of the panel under test; before ``open``."""
        ...


@runtime_checkable
class AcceptsCalibration(Protocol):
    """A touchscreen whose units are mapped to mm by a calibration."""

    def use_calibration(self, mapping: Mapping2D, device: str, rms_mm: float) -> None:
        """The mapping, the name of the calibrated touchscreen, and the fit's residual; before ``open``."""
        ...


@runtime_checkable
class Concludes(Protocol):
    """A source that has something left to say when nobody will read it any more."""

    def final_notices(self) -> tuple[Notice, ...]:
        """What has not been said yet; called once between the last ``read`` and ``close``, from the reading thread."""
        ...


@runtime_checkable
class Synchronises(Protocol):
    """A source that can compare its clock with the host's in full when it is asked to, before and after a block."""

    def synchronise(self) -> threading.Event:
        """Compare in the next ``read``, whatever else is going on; from any thread.

        Returns an event that is set when that has been tried, just before the read returns the comparisons.
        """
        ...
