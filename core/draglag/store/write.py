"""Writing session files: live, run by run, or a whole session at once.

While it grows a file is called ``<name>.partial``. Its layout is HDF5's oldest (``libver`` default), which
survives a killed writer; metadata reaches the disk only in ``flush``, so that what lies between two flushes is never
half there. What is lost with the process is what was appended since the last flush.
"""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterable, Mapping
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path
from types import TracebackType
from typing import Any

import h5py
import numpy as np

from draglag.errors import DataError
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
from draglag.store import schema
from draglag.store.checksum import raw_checksum
from draglag.store.lowlevel import put_attrs, put_node
from draglag.store.safely import read_attr

PARTIAL = ".partial"
RECORDING = "recording"


class SessionWriter:
    """One growing session file. Not for several threads at once.

    Args:
        path: final name of the file.
        header: the session; runs it already holds are written too.
        suffix: what the growing file's name ends on.

    Raises DataError where the file (or its ``.partial``) exists or cannot be made. Leaving a ``with`` block by an
    exception keeps the ``.partial`` for ``salvage``.
    """

    def __init__(self, path: Path | str, header: Session, suffix: str = PARTIAL) -> None:
        self.path = Path(path)
        self.partial = self.path.with_name(self.path.name + suffix)
        self._started = (header.started_utc, header.started_s)
        self._waiting: list[schema.Node] = []
        self._open_runs: set[str] = set()
        self._runs: set[str] = set()
        self._closed = False
        _refuse(self.path, self.partial)
        try:
            self._file = h5py.File(self.partial, "x")
        except OSError as error:
            raise DataError(
                f"{self.partial}: cannot be made ({reason(error)})", "Choose a folder you may write"
            ) from error
        _write_metadata_only_in_flush(self._file)
        try:
            self._put(schema.header_nodes(header))
            for run in header.runs:
                self._add_run(run, run.outcome)
            self.flush()
        except BaseException:
            self.abandon()
            self.partial.unlink()  # made a moment ago, and nothing was recorded yet
            raise

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
        """Make room for a run. What ``run`` already holds (target, axes, first samples) is written at once."""
        self._add_run(run, RECORDING)
        self._open_runs.add(run.id)
        self.flush()

    def append_touch(self, run_id: str, trace: TouchTrace) -> None:
        """Touch events in order of time; the axes belong to ``begin_run``."""
        self._wait(schema.touch_nodes(f"runs/{self._recording(run_id)}/touch", trace))

    def append_laser(self, run_id: str, trace: LaserTrace) -> None:
        self._wait(schema.laser_nodes(f"runs/{self._recording(run_id)}/laser", trace))

    def append_display(self, run_id: str, trace: DisplayTrace) -> None:
        self._wait(schema.display_nodes(f"runs/{self._recording(run_id)}/display", trace))

    def append_clock(self, bounds: ClockBounds, run_id: str | None = None) -> None:
        """Clock observations of one stream, of the whole session or of one run."""
        place = "clocks" if run_id is None else f"runs/{self._recording(run_id)}/sync"
        self._wait(schema.clock_nodes(place, bounds))

    def append_log(self, entry: LogEntry, run_id: str | None = None) -> None:
        """A line of the run's log, or of the session's notes."""
        place = "notes" if run_id is None else f"runs/{self._recording(run_id)}/log"
        self._wait(schema.log_nodes(place, [entry]))

    def append_taps(self, taps: Taps) -> None:
        self._wait(schema.taps_nodes(taps))

    def end_run(self, run_id: str, outcome: str, duration_s: float | None = None) -> None:
        """Give a run its one outcome; the file is safe on disk when this returns. Raises ValueError, DataError."""
        if outcome not in OUTCOMES:
            raise ValueError(f"{outcome!r} is not one of {OUTCOMES}")
        attrs: dict[str, schema.Value] = {"outcome": outcome}
        if duration_s is not None:
            attrs["duration_s"] = float(duration_s)
        self._wait([schema.Node(f"runs/{self._recording(run_id)}", attrs)])
        self._open_runs.discard(run_id)
        self.flush()
        self._to_disk()

    def flush(self) -> None:
        """Hand everything appended so far to the operating system. Call at least every 0.5 s. Raises DataError."""
        nodes, self._waiting = self._waiting, []
        self._put(_merged(nodes))
        try:
            self._file.flush()
        except (OSError, RuntimeError) as error:
            raise self._unwritable(error) from error

    def close(self) -> Path:
        """Finish the file and give it its name. Runs still open become "aborted". Never overwrites.

        Raises DataError when the name was taken meanwhile: the data stay in the ``.partial`` file.
        """
        if self._closed:
            return self.path
        for run_id in sorted(self._open_runs):
            self.end_run(run_id, "aborted")
        self.flush()
        put_attrs(self._file, {"raw_sha256": raw_checksum(self._file)})
        self.flush()
        self._to_disk()
        self.abandon()
        publish(self.partial, self.path)
        return self.path

    def abandon(self) -> None:
        """Close without the final name; ``salvage`` can read what was flushed."""
        if not self._closed:
            self._closed = True
            try:
                self._file.close()
            except (OSError, RuntimeError) as error:
                raise self._unwritable(error) from error

    def _add_run(self, run: Run, outcome: str) -> None:
        if run.id in self._runs:
            raise DataError(f"{self.path}: there are two runs “{run.id}”", "Give every run an id of its own")
        self._put(schema.run_nodes(run, outcome))
        self._runs.add(run.id)

    def _recording(self, run_id: str) -> str:
        if run_id not in self._open_runs:
            raise ValueError(f"run {run_id!r} is not being recorded")
        return run_id

    def _wait(self, nodes: Iterable[schema.Node]) -> None:
        self._waiting.extend(nodes)

    def _put(self, nodes: Iterable[schema.Node]) -> None:
        try:
            for node in map(self._apart, nodes):
                put_node(self._file, node, self._start(node))
        except (OSError, RuntimeError) as error:
            raise self._unwritable(error) from error

    def _apart(self, node: schema.Node) -> schema.Node:
        """Two streams whose names read the same as group names get a group each."""
        stream, path, number = node.attrs.get("stream"), node.path, 2
        while stream is not None and path in self._file and read_attr(self._file[path], "stream") != stream:
            path, number = f"{node.path}-{number}", number + 1
        return replace(node, path=path)

    def _start(self, node: schema.Node) -> str:
        """UTC at which the host's clock read zero, which is what ``time`` counts from."""
        started_utc, started_s = self._started
        if started_s is None and node.table is not None and node.table.scale.name == "time":
            # Nobody noted the host's clock: the session begins with its first run.
            run = self._file["/".join(node.path.split("/")[:2])]
            started_s = float(run.attrs["start_s"])
            self._started = (started_utc, started_s)
        return zero_utc(started_utc, started_s)

    def _to_disk(self) -> None:
        descriptor = os.open(self.partial, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)

    def _unwritable(self, error: BaseException) -> DataError:
        return DataError(
            f"{self.partial}: cannot be written ({reason(error)})",
            "Make room on the disk, then `draglag verify` that file to save what it holds",
        )


def write_session(session: Session, path: Path | str) -> Path:
    """Write a whole session. Raises DataError; never overwrites."""
    path = Path(path)
    # Its own suffix: what is salvaged from a .partial stands beside that file.
    writer = SessionWriter(path, session, f".{uuid.uuid4().hex[:8]}.tmp")
    try:
        return writer.close()
    except BaseException:
        writer.abandon()
        writer.partial.unlink(missing_ok=True)
        raise


def publish(source: Path, target: Path) -> None:
    """Give a finished file its name, atomically, unless that name is taken. Raises DataError."""
    try:
        os.link(source, target)
    except FileExistsError as error:
        raise DataError(
            f"{target}: exists already; the data are in {source.name} beside it", "Give that file another name"
        ) from error
    except OSError:  # a file system without hard links
        _refuse(target)
        source.rename(target)
    else:
        source.unlink()


def zero_utc(started_utc: str, started_s: float | None) -> str:
    """ISO 8601 of the host clock's zero, or empty where it is unknown."""
    try:
        return (datetime.fromisoformat(started_utc) - timedelta(seconds=started_s or 0.0)).isoformat()
    except (ValueError, OverflowError):
        return ""


def _refuse(*paths: Path) -> None:
    for path in paths:
        if path.is_symlink() or path.exists():
            partial = path.name.endswith(PARTIAL)
            remedy = f"Save what it holds with `draglag verify {path}`" if partial else "Choose another name"
            raise DataError(f"{path}: exists already and is not overwritten", remedy)
    folder = paths[0].absolute().parent
    if not folder.is_dir():
        raise DataError(f"{folder}: there is no such folder", "Make it first, or choose another")


def _write_metadata_only_in_flush(file: Any) -> None:
    """Keep HDF5 from writing dirty metadata whenever its cache feels full: a kill between flushes then finds the
    structure of the last flush, whole."""
    config = file.id.get_mdc_config()
    config.evictions_enabled = False
    config.incr_mode = 0
    config.flash_incr_mode = 0
    config.decr_mode = 0
    file.id.set_mdc_config(config)


def _merged(nodes: Iterable[schema.Node]) -> list[schema.Node]:
    """Many small batches as few large ones: one write a column and flush."""
    merged: dict[tuple[str, schema.Value | None], list[schema.Node]] = {}
    for node in nodes:
        merged.setdefault((node.path, node.attrs.get("stream")), []).append(node)
    return [_join(same) for same in merged.values()]


def _join(nodes: list[schema.Node]) -> schema.Node:
    if len(nodes) == 1:
        return nodes[0]
    first = nodes[0]
    attrs: dict[str, schema.Value] = {}
    counts: dict[str, int] = {}
    for node in nodes:
        attrs.update(node.attrs)
        for key, value in node.counts.items():
            counts[key] = counts.get(key, 0) + value
    rows = _join_rows(first.table, [node.rows for node in nodes]) if first.table is not None else {}
    return schema.Node(first.path, attrs, counts, first.texts, first.table, rows)


def _join_rows(table: schema.Table, parts: list[Mapping[str, Any]]) -> dict[str, Any]:
    lengths = [max((len(values) for values in part.values()), default=0) for part in parts]
    joined = {}
    for column in table.every():
        columns = [part.get(column.name, ()) for part in parts]
        if any(len(values) for values in columns):
            filled = [
                values if len(values) else np.full(length, column.fill, column.dtype)
                for values, length in zip(columns, lengths, strict=True)
            ]
            joined[column.name] = np.concatenate(filled)
    return joined


def reason(error: BaseException) -> str:
    """Why something could not be written, in the system's words."""
    if isinstance(error, OSError) and error.errno:
        return os.strerror(error.errno)
    return " ".join(str(error).split())[:200]
