"""Garbage collection in the windows' thread alone.

Python collects in whichever thread creates an object; a widget finalised in another thread ends the program.
"""

from __future__ import annotations

import gc

from PySide6.QtCore import QCoreApplication, QObject, QTimer

_EVERY_MS = 500


class Garbage(QObject):
    """Collects by Python's thresholds, at most twice a second."""

    def __init__(self, application: QCoreApplication) -> None:
        super().__init__(application)
        gc.disable()
        self._timer = QTimer(self)
        self._timer.timeout.connect(self.look)
        self._timer.start(_EVERY_MS)

    def look(self) -> None:
        """Collect the generations that are due."""
        limits, counts = gc.get_threshold(), gc.get_count()
        due = [k for k, (count, limit) in enumerate(zip(counts, limits, strict=True)) if 0 < limit < count]
        if due:
            gc.collect(due[-1])

    def stop(self) -> None:
        """Let Python collect again."""
        self._timer.stop()
        gc.enable()


def collect_in_this_thread(application: QCoreApplication) -> Garbage:
    """The application's only collector."""
    present = application.findChild(Garbage)
    return present if isinstance(present, Garbage) else Garbage(application)
