"""What was drawn for the participant, and when."""

from __future__ import annotations

import threading

import numpy as np

from draglag.recording import DisplayTrace


class FrameLog:
    """Frames drawn; written by the window, read by the session's thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._frames: list[tuple[float, float, float]] = []
        self._missed = 0

    def add(self, t_s: float, x_mm: float, y_mm: float, missed: int) -> None:
        with self._lock:
            self._frames.append((t_s, x_mm, y_mm))
            self._missed += missed

    def clear(self) -> None:
        with self._lock:
            self._frames.clear()
            self._missed = 0

    def take(self, until_s: float) -> DisplayTrace:
        """Frames up to ``until_s``, and those missed."""
        with self._lock:
            k = sum(frame[0] <= until_s for frame in self._frames)
            table = np.array(self._frames[:k]).reshape(-1, 3)
            self._frames = self._frames[k:]
            missed, self._missed = self._missed, 0
        return DisplayTrace(table[:, 0], table[:, 1], table[:, 2], missed)
