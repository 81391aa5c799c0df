"""A session recorded into a journal (``<name>.partial``), then a session file."""

from __future__ import annotations

import errno
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from types import TracebackType

from draglag.errors import DataError
from draglag.messages import message
from draglag.recording import (
    OUTCOMES,
    ClockBounds,
    DisplayTrace,
    LaserTrace,
    LogEntry,
    Run,
    Session,
    Taps,
    TouchTrace,
)
from draglag.store import schema, session_nodes
from draglag.store.build import build, reason
from draglag.store.codec import Record, encode
from draglag.store.frames import FrameFile, Locked, sync_folder
from draglag.store.journal import PARTIAL, RECORDING, nodes, survey
from draglag.store.nodes import merged, pieces, row_count, separate
from draglag.store.schema import Node
from draglag.system.temporary import refuse

# The session as a whole: said in every record, in full where a run begins and ends.
_HEADS = ("", "screen", "stylus", "beam", "devices", "details", "calibration")
# Rows of one table and record: of 0.2 s there are some hundreds; only runs handed over whole have more.
_RECORD_ROWS = 1 << 14


class SessionWriter:
    """One recording, for one thread; a call that raised DataError may be repeated, also after ``move``.

    Args:
        path: final name of the session file.
        header: the session; its runs are written too.

    Attributes:
        restored: how often others deleted the journal.

    Raises DataError where the file (or its journal) exists or cannot be made. An exception in a ``with`` block keeps
    the journal for ``salvage``.
    """

    def __init__(self, path: Path | str, header: Session) -> None:
        self.path = Path(path)
        self.restored = 0
        self._waiting: list[Node] = []
        self._owners: dict[str, schema.Value] = {}
        self._rows: dict[str, int] = {}
        self._open: dict[str, list[Node]] = {}
        self._ended: set[str] = set()
        self._runs: set[str] = set()
        self._full = 2  # records that say what the session is before the first run: one may get damaged
        self._closed = False
        refuse(self.path)
        _refuse_partial(self.partial)
        head = list(session_nodes.header_nodes(header))
        self._head = [node for node in head if node.path in _HEADS]
        self._wait(node for node in head if node.path not in _HEADS)
        for run in header.runs:
            self._begin(run)
            self._end(run.id, run.outcome, None)
        try:
            self._file = FrameFile(self.partial)
        except (OSError, Locked) as error:
            raise _cannot_make(self.partial, error) from error
        try:
            self._append([])
            self.flush()
        except BaseException as error:
            self.abandon()
            with suppress(OSError):
                self.partial.unlink(missing_ok=True)  # made a moment ago, and nothing was recorded yet
            raise _cannot_make(self.partial, error) if isinstance(error, OSError) else error from None

    @property
    def partial(self) -> Path:
        """The journal's path."""
        return self.path.with_name(self.path.name + PARTIAL)

    def __enter__(self) -> SessionWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        else:
            self.abandon()

    def begin_run(self, run: Run) -> None:
        """Begin a run with the data it holds; on disk when this returns."""
        self._begin(run)
        self.flush()

    def append_touch(self, run_id: str, trace: TouchTrace) -> None:
        """Append touch events in order of time."""
        self._wait(session_nodes.touch_nodes(f"runs/{self._recording(run_id)}/touch", trace))

    def append_laser(self, run_id: str, trace: LaserTrace) -> None:
        self._wait(session_nodes.laser_nodes(f"runs/{self._recording(run_id)}/laser", trace))

    def append_display(self, run_id: str, trace: DisplayTrace) -> None:
        self._wait(session_nodes.display_nodes(f"runs/{self._recording(run_id)}/display", trace))

    def append_clock(self, bounds: ClockBounds, run_id: str | None = None) -> None:
        """Append clock comparisons of one stream."""
        place = "clocks" if run_id is None else f"runs/{self._recording(run_id)}/sync"
        self._wait(session_nodes.clock_nodes(place, bounds))

    def append_log(self, entry: LogEntry, run_id: str | None = None) -> None:
        """Append to the run's log, or the session's notes."""
        place = "notes" if run_id is None else f"runs/{self._recording(run_id)}/log"
        self._wait(session_nodes.log_nodes(place, [entry]))

    def append_taps(self, taps: Taps) -> None:
        self._wait(session_nodes.taps_nodes(taps))

    def end_run(self, run_id: str, outcome: str, duration_s: float | None = None, flush: bool = True) -> None:
        """Set the run's outcome; with ``flush``, on disk when this returns. Raises ValueError, DataError."""
        if outcome not in OUTCOMES:
            raise ValueError(f"{outcome!r} is not one of {OUTCOMES}")
        self._end(self._recording(run_id), outcome, duration_s)
        if flush:
            self.flush()

    def flush(self) -> None:
        """Return once all is on disk. Call at least every 0.5 s: a crash costs what came later. Raises DataError."""
        self._waiting = [piece for node in merged(self._waiting) for piece in pieces(node, _RECORD_ROWS)]
        if not self._waiting:
            return
        try:
            if not self._file.in_place():
                self._file.move(self.partial)
                self.restored += 1
            for record in _packed(self._waiting):
                self._append(record)
                self._waiting = self._waiting[len(record) :]
        except (OSError, Locked) as error:
            raise self._unwritable(error) from error

    def move(self, path: Path | str) -> None:
        """Go on under another path with all data; unchanged on DataError."""
        path = Path(path)
        refuse(path)
        partial = path.with_name(path.name + PARTIAL)
        _refuse_partial(partial)
        try:
            self._file.move(partial)
        except (OSError, Locked) as error:
            raise _cannot_make(partial, error) from error
        self.path = path

    def close(self) -> Path:
        """The session file; the journal is deleted, or stays with a DataError. Open runs become "aborted"."""
        if self._closed:
            return self.path
        for run_id in sorted(set(self._open) - self._ended):
            self._end(run_id, "aborted", None)
        self.flush()
        try:
            found = survey(self._file.fd, str(self.partial))
            if found.records != self._file.count:
                raise DataError(message("{path}: some of it cannot be read back", path=self.partial), "Try again.")
            build(nodes(self._file.fd, found), self.path, self._file.size)
        except DataError as error:
            raise DataError(
                error.problem,
                message("{remedy} The recording is whole in {file}", remedy=error.remedy, file=self.partial),
            ) from error
        self._closed = True
        if self._file.in_place():
            with suppress(OSError):
                self.partial.unlink()
                sync_folder(self.path.absolute().parent)
        self._file.close()
        return self.path

    def abandon(self) -> None:
        """End without the session file; ``salvage`` can read what was flushed."""
        if not self._closed:
            self._closed = True
            self._file.close()

    def _begin(self, run: Run) -> None:
        if run.id in self._runs:
            raise DataError(
                message("{path}: there are two runs “{run}”", path=self.path, run=run.id),
                "Give every run an id of its own",
            )
        own = f"runs/{run.id}"
        every = list(session_nodes.run_nodes(run, RECORDING))
        heads = (own, f"{own}/target", f"{own}/touch/axes")
        self._open[run.id] = [node for node in every if node.path in heads]
        self._runs.add(run.id)
        self._full = max(self._full, 1)
        self._wait(node for node in every if node.path not in heads)

    def _end(self, run_id: str, outcome: str, duration_s: float | None) -> None:
        attrs: dict[str, schema.Value] = {"outcome": outcome}
        if duration_s is not None:
            attrs["duration_s"] = float(duration_s)
        self._wait([Node(f"runs/{run_id}", attrs)])
        self._ended.add(run_id)
        self._full = max(self._full, 1)

    def _recording(self, run_id: str) -> str:
        if run_id not in self._open or run_id in self._ended:
            raise ValueError(f"run {run_id!r} is not being recorded")
        return run_id

    def _wait(self, more: Iterable[Node]) -> None:
        self._waiting.extend(separate(node, self._owners) for node in more)

    def _append(self, record: list[Node]) -> None:
        heads = [*self._head, *(node for run in self._open.values() for node in run)]
        if not self._full:
            heads = [replace(node, texts={}) for node in heads if node.table is None]
        self._file.append(encode(Record(tuple(record), tuple(heads), self._rows, len(self._runs))))
        self._full = max(0, self._full - 1)
        for node in record:
            if node.table is not None:
                self._rows[node.path] = self._rows.get(node.path, 0) + row_count(node)
            run_id = node.path.removeprefix("runs/")
            if run_id in self._ended and "outcome" in node.attrs:
                self._forget(run_id)

    def _forget(self, run_id: str) -> None:
        self._ended.discard(run_id)
        del self._open[run_id]
        own = f"runs/{run_id}/"
        self._rows = {path: count for path, count in self._rows.items() if not path.startswith(own)}
        self._owners = {path: stream for path, stream in self._owners.items() if not path.startswith(own)}

    def _unwritable(self, error: BaseException) -> DataError:
        folder = self.partial.absolute().parent
        if not folder.is_dir():
            remedy = message("Name another place: the folder was removed while it was recorded into")
        elif isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
            remedy = message(
                "Make room on the disk, or name another place; what was saved before is whole in {file}",
                file=self.partial,
            )
        else:
            remedy = message("Name another place; what was saved before is whole in {file}", file=self.partial)
        return DataError(message("{path}: cannot be written ({why})", path=self.partial, why=reason(error)), remedy)


def _packed(waiting: list[Node]) -> list[list[Node]]:
    if sum(row_count(node) for node in waiting) <= _RECORD_ROWS:
        return [waiting]
    return [[node] for node in waiting]


def _cannot_make(partial: Path, error: BaseException) -> DataError:
    return DataError(
        message("{path}: cannot be made ({why})", path=partial, why=reason(error)),
        "Choose a folder you may write, with room",
    )


def _refuse_partial(partial: Path) -> None:
    if partial.is_symlink() or partial.exists():
        raise DataError(
            message("{path}: exists already and is not overwritten", path=partial),
            message("Save what it holds with `draglag verify {path}`", path=partial),
        )
