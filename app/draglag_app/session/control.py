"""The operator's requests to a session."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Place:
    """Where to go on saving; without a folder, the same place, which has room now."""

    folder: Path | None = None


class Control:
    """Requests that the session polls. Thread-safe.

    Args:
        auto: begin each run after the rest, without ``proceed()``.
        asks: somebody will call ``name_place`` when nothing can be saved.
        spare: folder to go on in, once, without asking.
        retries: queue runs that went wrong or gave no latency.
    """

    def __init__(self, auto: bool = True, asks: bool = False, spare: Path | None = None, retries: bool = False) -> None:
        self._changed = threading.Condition()
        self._auto = auto
        self._stop = False
        self._abort = False
        self._repeat = False
        self._proceed = False
        self._notes: list[str] = []
        self._asks = asks
        self._spare = spare
        self._place: Place | None = None
        self._retries = retries
        self._queue: list[str] = []

    def stop(self) -> None:
        """End the session; its file is closed."""
        with self._changed:
            self._stop = self._abort = True
            self._changed.notify_all()

    def abort_run(self) -> None:
        """End the run; its data are kept."""
        with self._changed:
            self._abort = True
            self._changed.notify_all()

    def repeat_run(self) -> None:
        """Record the present or last run again."""
        with self._changed:
            self._repeat = True
            self._changed.notify_all()

    def queue(self, run_id: str) -> None:
        """Record a planned run again after the others."""
        with self._changed:
            if run_id not in self._queue:
                self._queue.append(run_id)

    def unqueue(self, run_id: str) -> bool:
        """Whether the run was queued; it no longer is."""
        with self._changed:
            there = run_id in self._queue
            self._queue = [queued for queued in self._queue if queued != run_id]
            return there

    @property
    def queued(self) -> tuple[str, ...]:
        """Runs to record again, in order."""
        with self._changed:
            return tuple(self._queue)

    @property
    def retries(self) -> bool:
        return self._retries

    def proceed(self) -> None:
        """Begin the next run now."""
        with self._changed:
            self._proceed = True
            self._changed.notify_all()

    def name_place(self, folder: Path | None) -> None:
        """Save in that folder; None: where it was."""
        with self._changed:
            self._place = Place(folder)
            self._changed.notify_all()

    def no_place(self) -> None:
        """No place will be named: a session that cannot save ends."""
        with self._changed:
            self._asks, self._spare = False, None
            self._changed.notify_all()

    def note(self, text: str) -> None:
        """Add a note; the session stamps it when it takes it."""
        with self._changed:
            self._notes.append(text)
            self._changed.notify_all()

    @property
    def auto(self) -> bool:
        return self._auto

    @property
    def stopping(self) -> bool:
        with self._changed:
            return self._stop

    @property
    def aborting(self) -> bool:
        """Whether the run shall end."""
        with self._changed:
            return self._abort

    def take_abort(self) -> bool:
        """Whether an abort was requested; clears it, unless the session is to stop."""
        with self._changed:
            asked, self._abort = self._abort, self._stop
            return asked

    def take_repeat(self) -> bool:
        with self._changed:
            asked, self._repeat = self._repeat, False
            return asked

    @property
    def repeating(self) -> bool:
        """Whether a requested repeat has not begun."""
        with self._changed:
            return self._repeat

    def take_proceed(self) -> bool:
        with self._changed:
            asked, self._proceed = self._proceed, False
            return asked

    def take_notes(self) -> list[str]:
        with self._changed:
            notes, self._notes = self._notes, []
            return notes

    @property
    def has_place(self) -> bool:
        """Whether a place is, or may be, named."""
        with self._changed:
            return self._asks or self._spare is not None

    def wait_for_place(self, stoppable: bool) -> Place | None:
        """The named place; None if none will be, or (``stoppable``) the session is to stop."""
        with self._changed:
            if self._spare is not None:
                place, self._spare = Place(self._spare), None
                return place
            self._place = None
            self._changed.wait_for(lambda: self._place is not None or not self._asks or (stoppable and self._stop))
            return self._place

    def wait(self, timeout_s: float) -> None:
        """Wait for any request."""
        with self._changed:
            self._changed.wait(timeout_s)
