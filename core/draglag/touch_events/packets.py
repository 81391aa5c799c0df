"""Contacts of panels without slots (multi-touch protocol A)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from draglag.errors import DataError
from draglag.messages import message
from draglag.reading.limits import CONTACTS
from draglag.touch_events.frames import (
    ABS_MT_POSITION_X,
    ABS_MT_POSITION_Y,
    ABS_MT_TRACKING_ID,
    BTN_TOUCH,
    EV_ABS,
    EV_KEY,
    EV_SYN,
    SYN_DROPPED,
    SYN_REPORT,
    Contact,
    Frame,
    InputEvent,
)

SYN_MT_REPORT = 2


@dataclass(frozen=True)
class _Place:
    x: int
    y: int
    number: int | None  # the panel's own

    def far(self, other: _Place) -> float:
        return float((self.x - other.x) ** 2 + (self.y - other.y) ** 2)


@dataclass
class PacketDecoder:
    """As ``FrameDecoder``; contacts without numbers are matched to the nearest of the frame before."""

    _values: dict[int, int] = field(default_factory=dict)
    _places: list[_Place] = field(default_factory=list)
    _listed: bool = False  # whether this frame says what is down
    _down: dict[int, _Place] = field(default_factory=dict)
    _begun: int = 0
    _discarding: bool = False
    _dropped: bool = False

    def feed(self, event: InputEvent) -> Frame | None:
        """The frame that this event closes, or None."""
        if event.type == EV_SYN and event.code == SYN_DROPPED:
            self._discarding = True
        elif event.type == EV_SYN and event.code == SYN_REPORT:
            return self._report(event.t_s)
        elif event.type == EV_SYN and event.code == SYN_MT_REPORT:
            self._end_packet()
            self._listed = True
        elif event.type == EV_ABS:
            self._values[event.code] = event.value
        elif event.type == EV_KEY and event.code == BTN_TOUCH and not event.value:
            self._listed = True  # the empty list of a lift may be left out
        return None

    def _end_packet(self) -> None:
        values, self._values = self._values, {}
        if ABS_MT_POSITION_X in values and ABS_MT_POSITION_Y in values:
            number = values.get(ABS_MT_TRACKING_ID)
            if len(self._places) == CONTACTS:
                raise DataError(
                    message("a frame lists more than {most} contacts", most=CONTACTS), "record a touchscreen"
                )
            self._places.append(_Place(values[ABS_MT_POSITION_X], values[ABS_MT_POSITION_Y], number))
            self._listed = True

    def _report(self, t_s: float) -> Frame | None:
        self._end_packet()
        places, self._places = self._places, []
        listed, self._listed = self._listed, False
        if self._discarding:
            self._discarding, self._dropped = False, True
            return None
        before = self._down
        if listed:
            self._down = self._followed(places)
        contacts = tuple(Contact(own, place.x, place.y, listed) for own, place in sorted(self._down.items()))
        dropped, self._dropped = self._dropped, False
        return Frame(t_s, contacts, tuple(own for own in sorted(before) if own not in self._down), dropped=dropped)

    def _followed(self, places: list[_Place]) -> dict[int, _Place]:
        pairs = sorted(
            (place.far(known), own, k)
            for k, place in enumerate(places)
            for own, known in self._down.items()
            if place.number == known.number
        )
        found: dict[int, _Place] = {}
        left = dict(enumerate(places))
        for _, own, k in pairs:
            if own not in found and k in left:
                found[own] = left.pop(k)
        for place in left.values():
            found[self._begun] = place
            self._begun += 1
        return found


def decode_packets(events: Iterable[InputEvent]) -> Iterator[Frame]:
    """All frames of a stream of events."""
    decoder = PacketDecoder()
    for event in events:
        frame = decoder.feed(event)
        if frame is not None:
            yield frame
