"""From kernel input events to contacts (multi-touch protocol B, plain axes)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from draglag.messages import message
from draglag.recording import AxisInfo, FloatArray, TouchTrace

EV_SYN, EV_KEY, EV_ABS, EV_MSC = 0, 1, 3, 4
SYN_REPORT, SYN_DROPPED = 0, 3
BTN_TOUCH = 0x14A
ABS_X, ABS_Y = 0x00, 0x01
ABS_MT_SLOT, ABS_MT_POSITION_X, ABS_MT_POSITION_Y, ABS_MT_TRACKING_ID = 0x2F, 0x35, 0x36, 0x39
MSC_TIMESTAMP = 0x05

AXIS_NAMES = {ABS_X: "ABS_X", ABS_Y: "ABS_Y", ABS_MT_SLOT: "ABS_MT_SLOT",
              ABS_MT_POSITION_X: "ABS_MT_POSITION_X", ABS_MT_POSITION_Y: "ABS_MT_POSITION_Y",
              ABS_MT_TRACKING_ID: "ABS_MT_TRACKING_ID"}  # fmt: skip


@dataclass(frozen=True)
class InputEvent:
    t_s: float
    type: int
    code: int
    value: int


@dataclass(frozen=True)
class Contact:
    """One contact in one frame, device units. ``moved``: this frame reported its position."""

    contact_id: int
    x: int
    y: int
    moved: bool = True


@dataclass(frozen=True)
class Frame:
    """What one SYN_REPORT closed.

    ``contacts``: all that are down, by slot; ``device_t_s``: the digitiser's own unwrapped stamp (MSC_TIMESTAMP);
    ``dropped``: the kernel's buffer overflowed before; positions may be stale until ``resync``.
    """

    t_s: float
    contacts: tuple[Contact, ...]
    lifted: tuple[int, ...] = ()
    device_t_s: float | None = None
    dropped: bool = False


@dataclass
class _Slot:
    contact_id: int = -1
    x: int | None = None
    y: int | None = None
    moved: bool = False


@dataclass
class FrameDecoder:
    """Frames from events in order; without ``multitouch`` from ABS_X/Y, which the kernel's fuzz filter averages.

    After SYN_DROPPED all up to the next SYN_REPORT is discarded, as the kernel demands.
    """

    multitouch: bool = True
    _slots: dict[int, _Slot] = field(default_factory=dict)
    _current: int = 0
    _lifted: list[int] = field(default_factory=list)
    _discarding: bool = False
    _dropped: bool = False
    _plain_contacts: int = 0
    _stamp_us: int | None = None
    _stamp_seen: bool = False
    _stamp_wraps: int = 0

    def feed(self, event: InputEvent) -> Frame | None:
        """The frame that this event closes, or None."""
        if event.type == EV_SYN:
            if event.code == SYN_DROPPED:
                self._discarding = True
                return None
            if event.code != SYN_REPORT:
                return None
            if self._discarding:
                self._discarding, self._dropped = False, True
                return None
            return self._close(event.t_s)
        if self._discarding:
            return None
        if event.type == EV_ABS:
            self._absolute(event)
        elif event.type == EV_KEY and event.code == BTN_TOUCH and not self.multitouch:
            self._press(event.value != 0)
        elif event.type == EV_MSC and event.code == MSC_TIMESTAMP:
            self._stamp(event.value & 0xFFFFFFFF)
        return None

    def resync(self, slots: Mapping[int, tuple[int, int, int]], current: int = 0) -> None:
        """Replace all slots by the kernel's state: slot → (tracking id or −1, x, y)."""
        if not self.multitouch:
            contact, x, y = slots.get(0, (-1, 0, 0))
            self._press(contact >= 0)
            slot = self._slot()
            slot.x, slot.y, slot.moved = x, y, True
            return
        for number, slot in self._slots.items():
            if slot.contact_id >= 0 and slots.get(number, (-1, 0, 0))[0] != slot.contact_id:
                self._lifted.append(slot.contact_id)
        self._slots = {number: _Slot(values[0], values[1], values[2], True) for number, values in slots.items()}
        self._current = current

    def _slot(self) -> _Slot:
        return self._slots.setdefault(self._current, _Slot())

    def _absolute(self, event: InputEvent) -> None:
        x, y = (ABS_MT_POSITION_X, ABS_MT_POSITION_Y) if self.multitouch else (ABS_X, ABS_Y)
        if event.code == x:
            slot = self._slot()
            slot.x, slot.moved = event.value, True
        elif event.code == y:
            slot = self._slot()
            slot.y, slot.moved = event.value, True
        elif self.multitouch and event.code == ABS_MT_SLOT:
            self._current = event.value
        elif self.multitouch and event.code == ABS_MT_TRACKING_ID:
            slot = self._slot()
            if slot.contact_id >= 0:
                self._lifted.append(slot.contact_id)
            slot.contact_id = event.value

    def _press(self, down: bool) -> None:
        slot = self._slot()
        if not down and slot.contact_id >= 0:
            self._lifted.append(slot.contact_id)
            slot.contact_id = -1
        elif down and slot.contact_id < 0:
            slot.contact_id = self._plain_contacts
            self._plain_contacts += 1

    def _stamp(self, value_us: int) -> None:
        if self._stamp_us is not None and value_us < self._stamp_us:
            # A step back by most of 32 bits is a wrap; a smaller one is a restart after idling.
            self._stamp_wraps += self._stamp_us - value_us > 1 << 31
        self._stamp_us, self._stamp_seen = value_us, True

    def _close(self, t_s: float) -> Frame:
        contacts = tuple(
            Contact(slot.contact_id, slot.x, slot.y, slot.moved)
            for _, slot in sorted(self._slots.items())
            if slot.contact_id >= 0 and slot.x is not None and slot.y is not None
        )
        stamp = None
        if self._stamp_seen and self._stamp_us is not None:
            stamp = (self._stamp_us + (self._stamp_wraps << 32)) * 1e-6
        frame = Frame(t_s, contacts, tuple(self._lifted), stamp, self._dropped)
        for slot in self._slots.values():
            slot.moved = False
        self._lifted, self._dropped, self._stamp_seen = [], False, False
        return frame


def decode(events: Iterable[InputEvent], multitouch: bool = True) -> Iterator[Frame]:
    """All frames of a stream of events."""
    decoder = FrameDecoder(multitouch)
    for event in events:
        frame = decoder.feed(event)
        if frame is not None:
            yield frame


@dataclass(frozen=True)
class Mapping2D:
    """Device units → mm: ``x_mm = xx·x + xy·y + x0``, ``y_mm = yx·x + yy·y + y0``."""

    xx: float
    xy: float
    x0_mm: float
    yx: float
    yy: float
    y0_mm: float

    def __call__(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Raw positions, both (n,), in mm."""
        return self.xx * x + self.xy * y + self.x0_mm, self.yx * x + self.yy * y + self.y0_mm


def axis_scale(axis: AxisInfo, size_mm: float | None) -> tuple[float, float]:
    """mm per unit and offset of an axis, from ``size_mm`` (the panel), else its resolution. Raises ValueError."""
    span = axis.maximum - axis.minimum
    if size_mm is not None and span > 0:
        factor = size_mm / (span + 1)
    elif axis.resolution > 0:
        factor = 1.0 / axis.resolution
    else:
        raise ValueError(message("{axis} has no resolution and the size of the panel is not given", axis=axis.name))
    return factor, -axis.minimum * factor


def panel_mapping(
    x_axis: AxisInfo, y_axis: AxisInfo, width_mm: float | None = None, height_mm: float | None = None
) -> Mapping2D:
    """The mapping of two axes. Raises ValueError where an axis has no known size."""
    x_factor, x_offset = axis_scale(x_axis, width_mm)
    y_factor, y_offset = axis_scale(y_axis, height_mm)
    return Mapping2D(x_factor, 0.0, x_offset, 0.0, y_factor, y_offset)


@dataclass
class ContactFollower:
    """Follows the first contact until it lifts; ``ignored`` counts others."""

    current: int | None = None
    ignored: int = 0

    def pick(self, frame: Frame) -> Contact | None:
        """The followed contact of a frame, or None."""
        by_id = {contact.contact_id: contact for contact in frame.contacts}
        if self.current is not None and self.current not in by_id:
            self.current = None
        if self.current is None and by_id:
            self.current = next(iter(by_id))
        if self.current is None:
            return None
        self.ignored += len(by_id) - 1
        return by_id[self.current]


def touch_trace(
    frames: Sequence[Frame],
    mapping: Mapping2D,
    axes: tuple[AxisInfo, ...] = (),
    follower: ContactFollower | None = None,
) -> TouchTrace:
    """The followed contact as a trace; repeated positions stay. A frame after SYN_DROPPED marks a gap before it."""
    follower = follower if follower is not None else ContactFollower()
    rows: list[tuple[float, int, int, int, float]] = []
    gaps: list[tuple[float, float]] = []
    previous_s: float | None = None
    for frame in frames:
        if frame.dropped:
            gaps.append((frame.t_s if previous_s is None else previous_s, frame.t_s))
        previous_s = frame.t_s
        contact = follower.pick(frame)
        if contact is not None:
            stamp = np.nan if frame.device_t_s is None else frame.device_t_s
            rows.append((frame.t_s, contact.contact_id, contact.x, contact.y, stamp))
    table = np.array(rows, dtype=np.float64).reshape(-1, 5)
    x_mm, y_mm = mapping(table[:, 2], table[:, 3])
    trace = TouchTrace(table[:, 0], x_mm, y_mm, table[:, 1].astype(np.int64), table[:, 2], table[:, 3], axes=axes)
    if gaps:
        # How many events the kernel threw away is unknown: each overflow counts as at least one.
        trace = replace(trace, gaps_s=np.array(gaps), dropped=len(gaps))
    if len(table) and not np.isnan(table[:, 4]).any():
        trace = replace(trace, device_t_s=table[:, 4])
    return trace
