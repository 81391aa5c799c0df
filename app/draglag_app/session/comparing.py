"""Clock comparisons around blocks."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable

from draglag_app.session.saver import Saver
from draglag_app.session.watch import TICK_S
from draglag_devices.source import Source, Synchronises
from draglag_devices.timebase import TimeBase

# A comparison takes 0.15 s, and several seconds where a hub delays every answer.
_COMPARE_S = 8.0


class Comparisons:
    """Requests clock comparisons."""

    def __init__(self, sources: Iterable[Source], time_base: TimeBase, saver: Saver) -> None:
        self._comparing = {source.role: source for source in sources if isinstance(source, Synchronises)}
        self._time = time_base
        self._saver = saver

    def ask(self, roles: tuple[str, ...]) -> dict[str, threading.Event]:
        """Role → event, set when that source has compared."""
        living = {role: source for role, source in self._comparing.items() if role not in self._saver.lost}
        return {role: source.synchronise() for role, source in living.items() if role in roles}

    def wait(self, roles: tuple[str, ...]) -> None:
        """Ask, and wait until the comparisons are saved."""
        deadline_s = time.monotonic() + _COMPARE_S
        for role, done in self.ask(roles).items():
            while not done.wait(TICK_S) and time.monotonic() < deadline_s and role not in self._saver.lost:
                if self._saver.failure is not None:
                    return
            # What was compared travels behind what was read before.
            self._saver.wait_past(self._time.now(), (role,), max(0.0, deadline_s - time.monotonic()))
