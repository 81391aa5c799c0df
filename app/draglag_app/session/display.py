"""The participant's display."""

from __future__ import annotations

import threading
from typing import Protocol

import numpy as np

from draglag.protocol.targets import Target
from draglag.recording import DisplayTrace


class Display(Protocol):
    """Shows a target. Called from the session's thread."""

    def show(self, target: Target, start_s: float) -> None:
        """Draw the target; it moves from ``start_s`` (session clock) on."""
        ...

    def prompt(self, text: str) -> None:
        """Show a sentence; empty removes it."""
        ...

    def frames(self, until_s: float) -> DisplayTrace:
        """Frames since the last call, up to ``until_s``; ``missed`` counts late ones."""
        ...

    def hide(self) -> None:
        """Remove the target."""
        ...


class OffscreenDisplay:
    """Draws nothing; computes the frames of a screen."""

    def __init__(self, frame_hz: float = 60.0) -> None:
        self.frame_hz = frame_hz
        self._lock = threading.Lock()
        self._target: Target | None = None
        self._start_s = 0.0
        self._next = 0

    def show(self, target: Target, start_s: float) -> None:
        with self._lock:
            self._target, self._start_s, self._next = target, start_s, 0

    def prompt(self, text: str) -> None:
        pass

    def frames(self, until_s: float) -> DisplayTrace:
        with self._lock:
            if self._target is None:
                return DisplayTrace(np.empty(0), np.empty(0), np.empty(0))
            end_s = min(until_s - self._start_s, self._target.duration_s)
            # The tolerance keeps a frame on the last moment from being lost to rounding.
            stop = int(np.floor(end_s * self.frame_hz + 1e-6)) + 1
            t = np.arange(self._next, max(stop, self._next)) / self.frame_hz
            self._next = max(stop, self._next)
            return DisplayTrace(self._start_s + t, *self._target.position_mm(t))

    def hide(self) -> None:
        with self._lock:
            self._target = None
