"""Names of input events, for people."""

from __future__ import annotations

from collections.abc import Iterable

from draglag.messages import Message, message, phrase
from draglag.touch_events.frames import AXIS_NAMES, BTN_TOUCH, EV_ABS, EV_KEY

_OTHER_AXES = {0x02: "ABS_Z", 0x03: "ABS_RX", 0x04: "ABS_RY", 0x05: "ABS_RZ", 0x18: "ABS_PRESSURE"}


def event_names(kinds: Iterable[tuple[int, int]]) -> Message:
    """Names of events by (type, code)."""
    names = []
    for kind, code in sorted(set(kinds)):
        if kind == EV_ABS:
            names.append(AXIS_NAMES.get(code) or _OTHER_AXES.get(code) or f"ABS_{code:#04x}")
        elif kind == EV_KEY:
            names.append("BTN_TOUCH" if code == BTN_TOUCH else f"KEY_{code:#05x}")
        else:
            names.append(f"type {kind} code {code:#04x}")
    return phrase(", ".join(names)) if names else message("no axes")
