"""A session's clock: the host's, or a simulated one."""

from __future__ import annotations

import threading
import time
from typing import Protocol


class TimeBase(Protocol):
    """The time of one session."""

    realtime: bool

    def now(self) -> float:
        """The present, s."""
        ...

    def advance_to(self, t_s: float) -> None:
        """Move a simulated clock; no effect on the host's."""
        ...

    def wait_past(self, t_s: float, timeout_s: float) -> float:
        """``now()`` once past ``t_s``, or after ``timeout_s`` of real time."""
        ...


class HostTime:
    """CLOCK_MONOTONIC."""

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
    """A clock that only ``advance_to`` moves. Thread-safe."""

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
