"""Events of an input device that is no touchscreen."""

from __future__ import annotations

from collections.abc import Sequence

from draglag.touch_events.frames import EV_ABS, EV_KEY, InputEvent
from draglag.touch_events.names import event_names

AFTER_S = 3.0
# A tool in reach (BTN_TOOL_PEN …): a pen may hover for as long as it likes.
_TOOLS = range(0x140, 0x148)


class UselessEvents:
    """Detects, once, 3 s of events without contact."""

    def __init__(self) -> None:
        self._seen: set[tuple[int, int]] = set()
        self._first_s: float | None = None
        self._settled = False

    def take(self, events: Sequence[InputEvent], touched: bool) -> str:
        """Axes and keys seen, when detected; else empty."""
        self._settled |= touched or any(event.type == EV_KEY and event.code in _TOOLS for event in events)
        seen = [event for event in events if event.type in (EV_ABS, EV_KEY)]
        if self._settled or not seen:
            return ""
        self._seen |= {(event.type, event.code) for event in seen}
        if self._first_s is None:
            self._first_s = seen[0].t_s
        self._settled = seen[-1].t_s - self._first_s >= AFTER_S
        return event_names(self._seen) if self._settled else ""
