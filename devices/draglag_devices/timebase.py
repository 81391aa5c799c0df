"""The clock a session runs on: the host's own, or a stepped one that runs as fast as the computer allows."""

from __future__ import annotations

import threading
import time
from typing import Protocol


class TimeBase(Protocol):
    """Seconds that everybody in one session agrees on."""

    realtime: bool

    def now(self) -> float:
        """The present, s."""
        ...

    def advance_to(self, t_s: float) -> None:
        """Let time run up to ``t_s`` (a stepped clock moves there at once; the host's does as it likes)."""
        ...

    def wait_past(self, t_s: float, timeout_s: float) -> float:
        """Return ``now()`` once it is later than ``t_s``, at the latest after ``timeout_s`` of real time."""
        ...


class HostTime:
    """CLOCK_MONOTONIC of the host."""

    realtime = True

    def now(self) -> float:
        return time.monotonic()

    def advance_to(self, t_s: float) -> None:
        pass

    def wait_past(self, t_s: float, timeout_s: float) -> float:
        wait = min(timeout_s, max(0.0, t_s - time.monotonic()))
        if wait > 0:
            time.sleep(wait)
        return time.monotonic()


class SteppedTime:
    """A simulated clock: time stands still until the session advances it, then has already passed."""

    realtime = False

    def __init__(self, start_s: float = 0.0) -> None:
        self._now_s = start_s
        self._moved = threading.Condition()

    def now(self) -> float:
        with self._moved:
            return self._now_s

    def advance_to(self, t_s: float) -> None:
        with self._moved:
            self._now_s = max(self._now_s, t_s)
            self._moved.notify_all()

    def wait_past(self, t_s: float, timeout_s: float) -> float:
        with self._moved:
            self._moved.wait_for(lambda: self._now_s > t_s, timeout_s)
            return self._now_s
