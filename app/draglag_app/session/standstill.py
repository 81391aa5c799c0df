"""Detects that the program stood still: stopped, suspended, overloaded."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from draglag.messages import message

# Between two samples. A reader waits 0.1 s at most for its device.
_PERIOD_S = 0.05
# A thread that wakes so late did not merely wait its turn: on two cores with a load of 12 the longest wait in a minute
# was 1.0 s (half of all waits: 3 ms).
LATE_S = 1.5
# The two clocks are read microseconds apart and slewed alike: they differ by this only where the computer slept.
SLEPT_S = 0.1


@dataclass(frozen=True)
class Standstill:
    """A time in which this program did not run (CLOCK_MONOTONIC); ``suspended_s``: asleep."""

    from_s: float
    to_s: float
    suspended_s: float

    def message(self) -> str:
        """A sentence for the operator."""
        if self.suspended_s > SLEPT_S:
            return message(
                "the computer was suspended for {s:.1f} s: nothing was recorded meanwhile. Keep it awake, and "
                "record the run again.",
                s=self.suspended_s,
            )
        return message(
            "this program did not run for {s:.1f} s (it was stopped, or the computer was too busy): the "
            "target stood still and events may be lost. Record the run again.",
            s=self.to_s - self.from_s,
        )


def _clocks() -> tuple[float, float]:
    boot_s = time.clock_gettime(time.CLOCK_BOOTTIME) if hasattr(time, "CLOCK_BOOTTIME") else time.monotonic()
    return time.monotonic(), boot_s


class Pulse:
    """Samples clocks twenty times a second in a thread. Thread-safe."""

    def __init__(self, clocks: Callable[[], tuple[float, float]] = _clocks) -> None:
        self._clocks = clocks
        self._lock = threading.Lock()
        self._found: list[Standstill] = []
        self._last = clocks()
        self._ending = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        self._last = self._clocks()
        self._thread = threading.Thread(target=self._run, name="draglag-pulse", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        self._ending.set()
        if self._thread is not None:
            self._thread.join()

    def take(self) -> list[Standstill]:
        """Standstills since the last call."""
        self._sample()
        with self._lock:
            found, self._found = self._found, []
            return found

    def _run(self) -> None:
        while not self._ending.wait(_PERIOD_S):
            self._sample()

    def _sample(self) -> None:
        with self._lock:
            now_s, boot_s = self._clocks()
            before_s, boot_before_s = self._last
            self._last = (now_s, boot_s)
            suspended_s = (boot_s - boot_before_s) - (now_s - before_s)
            if now_s - before_s > LATE_S or suspended_s > SLEPT_S:
                self._found.append(Standstill(before_s, now_s, suspended_s))
