"""The writer thread, the only one that touches the file while it records.

Data are saved before events about them are emitted. Events outside runs are shown and not kept.
"""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from draglag.errors import DataError, DraglagError, cause, message_of
from draglag.messages import message
from draglag.recording import ClockBounds, DisplayTrace, LaserTrace, LogEntry, Run, TouchTrace
from draglag.store import SessionWriter
from draglag_app.session import events
from draglag_app.session.digest import digest, within
from draglag_app.session.open_run import OpenRun
from draglag_app.session.readers import Lost, Reported
from draglag_app.session.taps import TapPairer
from draglag_devices.source import Batch, DeviceError

# A crash may cost at most 0.5 s of data; live plots follow the flushes.
FLUSH_S = 0.2
DELETED = message("was deleted while it was recorded into, and was written again")
_T = TypeVar("_T")


class Saver:
    """Processes batches and requests in order.

    After a write failure data wait in memory until ``resume``.

    Attributes:
        failure: why nothing can be saved.
        lost: role → error of a source gone for good.
    """

    def __init__(
        self, inbox: queue.Queue[object], writer: SessionWriter, listener: events.Listener, roles: Iterable[str]
    ) -> None:
        self._inbox = inbox
        self._writer = writer
        self._listener = listener
        self._progress = threading.Condition()
        self._marks = dict.fromkeys(roles, -np.inf)
        self.lost: dict[str, DeviceError] = {}
        self.failure: DraglagError | None = None
        self._run: OpenRun | None = None
        self._pairer: TapPairer | None = None
        self._taps = {"down": 0, "release": 0, "rejected": 0}
        self._losses: dict[str, int] = {}
        self._clocks: list[ClockBounds] = []
        self._pending_events: list[events.Event] = []
        self._flushed = time.monotonic()
        self._restored = 0
        self._listener_failed = False
        self.thread = threading.Thread(target=self._work, name="draglag-writer", daemon=True)

    @property
    def path(self) -> Path:
        """Where the session file will be."""
        return self._writer.path

    @property
    def partial(self) -> Path:
        """The journal."""
        return self._writer.partial

    @property
    def tap_count(self) -> int:
        """Taps saved with touch and release."""
        return min(self._taps["down"], self._taps["release"])

    def call(self, action: Callable[[], _T]) -> _T:
        """The action's result, from the writer's thread after all that is queued. Raises what it raises."""
        result: Future[_T] = Future()

        def act() -> None:
            try:
                result.set_result(action())
            except Exception as error:  # it belongs to whoever asked
                result.set_exception(error)

        self._inbox.put(act)
        return result.result()

    def lagging_roles(self, t_s: float, roles: Iterable[str]) -> list[str]:
        """Living sources that have not reported past ``t_s``."""
        return [role for role in roles if role not in self.lost and self._marks.get(role, np.inf) < t_s]

    def wait_past(self, t_s: float, roles: tuple[str, ...], timeout_s: float) -> list[str]:
        """Living sources not saved past ``t_s`` in time; empty, at once, when saving has failed."""
        with self._progress:
            self._progress.wait_for(lambda: not self.lagging_roles(t_s, roles) or self.failure is not None, timeout_s)
            return [] if self.failure is not None else self.lagging_roles(t_s, roles)

    @property
    def clocks(self) -> tuple[ClockBounds, ...]:
        """Clock comparisons saved outside runs."""
        return tuple(self._clocks)

    # --- actions: they run in the writer's thread, through ``call`` ------------------------------------------

    def begin_run(self, run: Run, to_s: float) -> None:
        """Save samples from ``run.start_s`` to ``to_s`` in a new run. Raises DraglagError."""
        if self.failure is not None:
            raise self.failure.with_traceback(None)
        self._run = OpenRun(run, to_s)
        self._keep(lambda: self._writer.begin_run(run))

    def resume(self, path: Path | None) -> None:
        """Save again, as ``path`` (None: where it was). Raises DraglagError."""
        if path is not None:
            self._writer.move(path)
        self._keep(self._writer.flush)
        with self._progress:
            self.failure = None

    def cut_run(self, to_s: float) -> None:
        """End the run earlier than planned."""
        if self._run is not None:
            self._run.to_s = min(self._run.to_s, to_s)

    def so_far(self) -> Run | None:
        """The open run as saved, with its planned duration; None if saving has failed."""
        opened = self._run
        if opened is None or self.failure is not None:
            return None
        return opened.assembled(opened.run.outcome, opened.run.duration_s)

    def end_run(self, outcome: str, duration_s: float) -> Run | None:
        """The ended run, on disk.

        "failed" if saving had failed; if it fails now, the run waits in memory.
        """
        opened, self._run = self._run, None
        if opened is None:
            return None
        run = opened.assembled(outcome, duration_s)
        saving = self.failure is None
        run = run if saving else replace(run, outcome="failed")
        with suppress(DraglagError):  # it is kept as ``failure``
            self._keep(lambda: self._writer.end_run(run.id, run.outcome, duration_s, flush=saving))
        self._emit_pending()
        return run

    def append_display(self, trace: DisplayTrace) -> None:
        opened = self._run
        if opened is not None and (len(trace.t_s) or trace.missed):
            self._keep(lambda: self._writer.append_display(opened.run.id, trace))
            opened.display.append(trace)

    def log(self, entry: LogEntry) -> None:
        """Add to the open run's log, or the session's notes."""
        opened = self._run
        self._keep(lambda: self._writer.append_log(entry, None if opened is None else opened.run.id))
        if opened is not None:
            opened.log.append(entry)

    def give_up(self, role: str) -> None:
        """Treat a source as lost."""
        error = DeviceError(role, message("the {role} source does not report any more", role=role), "check the device")
        self._take_loss(Lost(role, error))

    def begin_taps(self) -> None:
        """Pair shocks and contacts from now on."""
        self._pairer = TapPairer()

    def end_taps(self) -> None:
        self._pair(np.inf)
        self._pairer = None

    # --- the thread -----------------------------------------------------------------------------------------

    def _work(self) -> None:
        while True:
            wait_s = max(0.0, self._flushed + FLUSH_S - time.monotonic())
            try:
                item = self._inbox.get(timeout=max(wait_s, 0.005))
            except queue.Empty:
                item = self._flush_due
            try:
                if item is not None:
                    self._take(item)
                self._flush_due(force=item is None)
            except DraglagError as error:
                self._fail(error)
            except Exception as error:  # an unforeseen fault must end the run with an outcome, not the thread
                self._fail(DataError(message("{path}: cannot be written ({why})", path=self.partial, why=error)))
            if item is None:
                self._emit_pending()
                return

    def _take(self, item: Any) -> None:
        if isinstance(item, Reported):
            try:
                self._take_batch(item.role, item.batch)
            finally:
                with self._progress:
                    self._marks[item.role] = max(self._marks[item.role], item.batch.until_s)
                    self._progress.notify_all()
        elif isinstance(item, Lost):
            self._take_loss(item)
        else:
            item()

    def _take_loss(self, item: Lost) -> None:
        if item.role in self.lost:
            return
        with self._progress:
            self.lost[item.role] = item.error
            self._progress.notify_all()
        error = item.error
        self._pending_events.append(events.DeviceFault(item.role, error.source, error.problem, error.remedy))
        t_s = self._marks[item.role]
        with suppress(DraglagError):  # it is kept as ``failure``
            self.log(LogEntry(t_s if np.isfinite(t_s) else 0.0, "error", item.role, error.message))

    def _take_batch(self, role: str, batch: Batch) -> None:
        opened = self._run
        for notice in batch.notices:
            self.log(LogEntry(notice.t_s, notice.level, role, notice.text))
            self._pending_events.append(events.NoticeRaised(notice.t_s, notice.level, role, notice.text, notice.state))
        if batch.clock is not None and len(batch.clock.device_s):
            self._take_clock(batch.clock, opened)
        touch, laser = batch.touch, batch.laser
        if opened is not None:
            self._take_samples(touch, laser, opened)
        if self._pairer is not None:
            self._pairer.add(batch.taps, batch.contacts, batch.until_s)
            self._marks[role] = max(self._marks[role], batch.until_s)
            self._pair(min((self._marks[r] for r in ("touch", "walt") if r in self._marks), default=np.inf))
        lost = (0 if touch is None else touch.dropped) + (0 if laser is None else laser.missed)
        self._losses[role] = self._losses.get(role, 0) + lost
        seen = digest(role, "" if opened is None else opened.run.id, batch, self._losses[role])
        if seen is not None:
            self._pending_events.append(seen)

    def _take_samples(self, touch: TouchTrace | None, laser: LaserTrace | None, opened: OpenRun) -> None:
        if touch is not None:
            kept = within(touch, opened.run.start_s, opened.to_s)
            self._keep(lambda: self._writer.append_touch(opened.run.id, kept))
            opened.touch.append(kept)
        if laser is not None:
            edges = within(laser, opened.run.start_s, opened.to_s)
            self._keep(lambda: self._writer.append_laser(opened.run.id, edges))
            opened.laser.append(edges)

    def _take_clock(self, bounds: ClockBounds, opened: OpenRun | None) -> None:
        run_id = None if opened is None else opened.run.id
        self._keep(lambda: self._writer.append_clock(bounds, run_id))
        if opened is not None:
            opened.sync.setdefault(bounds.stream, []).append(bounds)
        else:
            self._clocks.append(bounds)

    def _pair(self, until_s: float) -> None:
        if self._pairer is None:
            return
        taps = self._pairer.take(until_s)
        if len(taps.physical_s) == 0 and not taps.rejected:
            return
        self._keep(lambda: self._writer.append_taps(taps))
        self._taps["down"] += int((taps.down == 1).sum())
        self._taps["release"] += int((taps.down == 0).sum())
        self._taps["rejected"] += sum(taps.rejected.values())
        self._pending_events.append(events.TapsArrived(**self._taps))

    def _keep(self, append: Callable[[], _T]) -> _T:
        try:
            done = append()
        except OSError as error:
            failure: DraglagError = DataError(
                message("{path}: cannot be written ({why})", path=self.partial, why=cause(error))
            )
        except DraglagError as error:
            failure = error
        else:
            if self._writer.restored > self._restored:
                self._restored = self._writer.restored
                self._pending_events.append(
                    events.NoticeRaised(
                        0.0, "warning", "file", message("{path}: {what}", path=self.partial, what=DELETED)
                    )
                )
            return done
        self._fail(failure)
        raise failure

    def _flush_due(self, force: bool = False) -> None:
        if not force and time.monotonic() - self._flushed < FLUSH_S:
            return
        self._flushed = time.monotonic()
        if self.failure is None:
            self._keep(self._writer.flush)
        self._emit_pending()

    def _emit_pending(self) -> None:
        pending, self._pending_events = self._pending_events, []
        for event in pending:
            try:
                self._listener(event)
            except Exception as error:  # whatever it is, the recording goes on
                self._report_listener(error)

    def _report_listener(self, error: Exception) -> None:
        """Log the first fault of the listener, and emit it: other events may still arrive there."""
        if self._listener_failed:
            return
        self._listener_failed = True
        what = f"{type(error).__name__}: {error}"
        text = message("a listener to the recording failed ({error}); the recording goes on", error=what)
        t_s = max((mark for mark in self._marks.values() if np.isfinite(mark)), default=0.0)
        with suppress(DraglagError):  # it is kept as ``failure``
            self.log(LogEntry(t_s, "error", "listener", text))
        self._pending_events.append(events.NoticeRaised(t_s, "error", "listener", text))

    def _fail(self, error: DraglagError) -> None:
        if self.failure is None:
            with self._progress:
                self.failure = error
                self._progress.notify_all()
            self._pending_events.append(events.NoticeRaised(0.0, "error", "file", message_of(error)))
