"""The kernel's input events, whichever program recorded them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from draglag.errors import DataError, message_of
from draglag.messages import message
from draglag.reading.limits import CONTACTS, TIME_S
from draglag.recording import AxisInfo, TouchTrace
from draglag.touch_events.frames import (
    ABS_MT_POSITION_X,
    ABS_MT_POSITION_Y,
    ABS_MT_SLOT,
    ABS_X,
    ABS_Y,
    EV_ABS,
    EV_KEY,
    EV_SYN,
    Frame,
    InputEvent,
    Mapping2D,
    decode,
    panel_mapping,
    touch_trace,
)
from draglag.touch_events.names import event_names
from draglag.touch_events.packets import SYN_MT_REPORT, decode_packets


@dataclass(frozen=True)
class InputLog:
    """Events of one device.

    ``axes``: axis code → range; ``size_mm``: the panel's (width, height); ``cut``: whether the last line was cut off.
    """

    name: str
    events: tuple[InputEvent, ...]
    axes: dict[int, AxisInfo] = field(default_factory=dict)
    size_mm: tuple[float, float] | None = None
    cut: bool = False

    @property
    def multitouch(self) -> bool:
        """Whether positions come as ABS_MT_POSITION_*."""
        return ABS_MT_POSITION_X in self.axes or any(
            event.type == EV_ABS and event.code == ABS_MT_POSITION_X for event in self.events
        )

    @property
    def without_slots(self) -> bool:
        """Whether contacts are listed frame by frame (multi-touch protocol A)."""
        kinds = {(event.type, event.code) for event in self.events}
        slots = ABS_MT_SLOT in self.axes or (EV_ABS, ABS_MT_SLOT) in kinds
        return self.multitouch and not slots and (EV_SYN, SYN_MT_REPORT) in kinds

    def frames(self) -> list[Frame]:
        """The events as frames."""
        if self.without_slots:
            return list(decode_packets(self.events))
        return list(decode(self.events, self.multitouch))

    def position_axes(self) -> tuple[AxisInfo, AxisInfo] | None:
        """The x and y axis, where described."""
        codes = (ABS_MT_POSITION_X, ABS_MT_POSITION_Y) if self.multitouch else (ABS_X, ABS_Y)
        if codes[0] in self.axes and codes[1] in self.axes:
            return self.axes[codes[0]], self.axes[codes[1]]
        return None

    def touch(self, mapping: Mapping2D) -> TouchTrace:
        """The followed contact. Raises DataError where there is none."""
        frames = self.frames()
        if not any(frame.contacts for frame in frames):
            kinds = ((event.type, event.code) for event in self.events if event.type in (EV_KEY, EV_ABS))
            raise DataError(
                message("the recording holds no touch: it has {axes}", axes=event_names(kinds)),
                "record a touchscreen, from before it is touched",
            )
        return touch_trace(frames, mapping, self.position_axes() or ())


def mapping_of(log: InputLog, width_mm: float | None, height_mm: float | None, units_per_mm: float | None) -> Mapping2D:
    """Device units → mm, by ``units_per_mm``, else the panel's size, else the axes' resolution. Raises DataError."""
    if units_per_mm is not None:
        if units_per_mm <= 0:
            raise DataError("units_per_mm must be above 0", "give the digitiser's units per mm")
        return Mapping2D(1 / units_per_mm, 0.0, 0.0, 0.0, 1 / units_per_mm, 0.0)
    axes = log.position_axes()
    if axes is None:
        raise DataError("the recording does not describe its axes", "give the digitiser's units per mm")
    try:
        return panel_mapping(*axes, width_mm, height_mm)
    except ValueError as error:
        raise DataError(message_of(error), "give the size of the panel") from None


def checked_event(t_s: float, kind: int, code: int, value: int) -> InputEvent:
    """An event. Raises ValueError for numbers that struct input_event cannot hold."""
    if not 0 <= t_s <= TIME_S:
        raise ValueError("no time")
    if not (0 <= kind <= 0xFFFF and 0 <= code <= 0xFFFF and -(2**31) <= value < 2**32):
        raise ValueError("beyond what the field holds")  # unsigned where a stamp was written so
    if (kind, code) == (EV_ABS, ABS_MT_SLOT) and not 0 <= value < CONTACTS:
        raise ValueError("no slot of a touchscreen")
    return InputEvent(t_s, kind, code, value)


def refuse_step_back(events: Sequence[InputEvent], where: str, line: int) -> None:
    """Raise DataError where the last event is earlier than the one before."""
    if len(events) > 1 and events[-1].t_s < events[-2].t_s:
        raise DataError(
            message("{path}, line {line}: the time goes back", path=where, line=line),
            "record again, or correct that line",
        )


def whole(word: str, base: int = 10) -> int:
    """A whole number of at most 11 characters. Raises ValueError."""
    if len(word) > 11:
        raise ValueError("too many digits")
    return int(word, base)
