"""A journal as nodes of a session, with what is missing."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from draglag.errors import DataError, cause
from draglag.messages import joined, message, phrase
from draglag.recording import LogEntry, empty_laser, empty_touch
from draglag.store import schema, session_nodes
from draglag.store.build import fill
from draglag.store.codec import Record, decode
from draglag.store.frames import MAGIC, Locked, bytes_after, frames, lock
from draglag.store.nodes import row_count
from draglag.store.schema import Node

RECORDING = "recording"
PARTIAL = ".partial"
UNFINISHED = message("the recording was not closed")
_HDF5 = b"\x89HDF\r\n\x1a\n"
_NO_TIMES = np.empty(0)
# Words for the streams of which rows can be missing.
_STREAMS = {
    "touch": (message("touch events"), "dropped"),
    "laser": (message("laser edges"), "missed"),
    "gaps": (message("marked gaps"), ""),
    "display": (message("frames of the display"), ""),
    "sync": (message("clock comparisons"), ""),
    "clocks": (message("clock comparisons"), ""),
    "taps": (message("taps"), ""),
    "log": (message("lines of the log"), ""),
    "notes": (message("notes"), ""),
}


@dataclass
class RunFound:
    head: list[Node] = field(default_factory=list)
    outcome: str = RECORDING
    last_s: float = -np.inf
    losses: list[str] = field(default_factory=list)


@dataclass
class Survey:
    """A journal scanned once.

    Attributes:
        session: the fullest attributes that could be read.
        holes: number of a record → nodes that mark rows missing before it.
        begun: runs begun, including unreadable ones.
    """

    session: list[Node] = field(default_factory=list)
    runs: dict[str, RunFound] = field(default_factory=dict)
    holes: dict[int, list[Node]] = field(default_factory=dict)
    losses: list[str] = field(default_factory=list)
    records: int = 0
    begun: int = 0
    last: int = -1
    last_s: float = 0.0
    unfinished_bytes: int = 0


def is_journal(path: Path) -> bool:
    """Whether a file is a journal; early ``.partial`` files are HDF5, not journals."""
    if not path.is_file():  # opening a pipe would wait for its other end
        return False
    try:
        with path.open("rb") as file:
            head = file.read(len(_HDF5))
    except OSError:
        return False
    return head.startswith(MAGIC) or (path.name.endswith(PARTIAL) and head != _HDF5)


@contextmanager
def open_journal(path: Path) -> Iterator[int]:
    """Yields its descriptor, read only. Raises DataError."""
    try:
        fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except OSError as error:
        raise DataError(
            message("{path}: cannot be read ({why})", path=path, why=cause(error)), "Check name and rights"
        ) from error
    try:
        yield fd
    finally:
        os.close(fd)


def lock_journal(fd: int, path: Path) -> bool:
    """As ``frames.lock``; raises DataError where another process records."""
    try:
        return lock(fd)
    except Locked:
        raise DataError(
            message("{path}: another program is writing it", path=path), "Wait until the recording has ended"
        ) from None


def survey(fd: int, where: str) -> Survey:
    """The survey of all records. Raises DataError where none describes the session."""
    found = Survey()
    if os.fstat(fd).st_size == 0:
        raise DataError(message("{path}: is empty: the recording ended before it began", path=where), "Delete it")
    received: dict[str, int] = {}
    last_s: dict[str, float] = {}
    expected, end = 0, 0
    for number, record, after in records(fd):
        if number > expected:
            found.losses.append(_records_missing(expected, number - 1))
        expected, end, found.last = number + 1, max(end, after), number
        found.records += 1
        _take_heads(found, record)
        for path, before in record.rows.items():
            missing = before - received.get(path, 0)
            if missing > 0:
                _hole(found, number, path, missing, last_s.get(path), record)
                received[path] = before
        if record.runs > found.begun:
            whole = record.runs - max(found.begun, len(found.runs))
            found.losses += [message("{n} runs are missing whole", n=whole)] if whole > 0 else []
            found.begun = record.runs
        _count_rows(found, record, received, last_s)
    if not {"", "screen", "stylus"} <= {node.path for node in found.session}:
        raise DataError(
            message(
                "{path}: holds {records} readable records, and none says what the session is",
                path=where,
                records=found.records,
            ),
            "Keep the file; try another copy of it",
        )
    found.unfinished_bytes = bytes_after(fd, end)
    if found.unfinished_bytes:
        found.losses.append(message("the last {n} bytes are no whole record", n=found.unfinished_bytes))
    return found


def in_memory(fd: int, where: str) -> Any:
    """HDF5 in memory of the session so far. Raises DataError."""
    found = survey(fd, where)
    lost = joined("; ", (UNFINISHED, *remarks(found)))
    file = h5py.File(where, "w", driver="core", backing_store=False)
    try:
        fill(file, nodes(fd, found, [LogEntry(found.last_s, "warning", "file", lost)]))
    except BaseException:
        file.close()
        raise
    return file


def nodes(fd: int, found: Survey, notes: Iterable[LogEntry] = ()) -> Iterator[Node]:
    """Nodes in order of recording, with ``notes`` added."""
    yield from found.session
    yield Node("runs")
    for run_id, run in found.runs.items():
        yield from run.head
        yield Node(f"runs/{run_id}/target")
        yield from session_nodes.touch_nodes(f"runs/{run_id}/touch", empty_touch())
        yield from session_nodes.laser_nodes(f"runs/{run_id}/laser", empty_laser())
    count = 0
    for number, record, _ in records(fd):
        if number > found.last:
            break  # recorded since the scan
        count += 1
        yield from found.holes.get(number, ())
        yield from (node for node in record.nodes if _run_of(node.path) in (None, *found.runs))
    if count != found.records:
        raise DataError(message("{n} records could be read once and not again", n=found.records - count), "Try again")
    for run_id, run in found.runs.items():
        yield Node(f"runs/{run_id}", {"outcome": outcome(run)})
        if run.losses:
            at_s = run.last_s if np.isfinite(run.last_s) else _span(run)[0]
            words = joined("; ", run.losses)
            yield from session_nodes.log_nodes(f"runs/{run_id}/log", [LogEntry(at_s, "error", "file", words)])
    yield from session_nodes.log_nodes("notes", notes)


def outcome(run: RunFound) -> str:
    """ "aborted" where the run's end was not recorded, "failed" where rows are missing."""
    if run.outcome == RECORDING:
        return "aborted"
    return "failed" if run.losses and run.outcome == "complete" else run.outcome


def all_losses(found: Survey) -> tuple[str, ...]:
    """Losses of runs, then of the session."""
    of_runs = [f"{run_id}: {loss}" for run_id, run in found.runs.items() for loss in run.losses]
    return (*of_runs, *found.losses)


def remarks(found: Survey) -> tuple[str, ...]:
    """Runs that were cut off, and all losses."""
    cut = [message("{run} was cut off", run=run_id) for run_id, run in found.runs.items() if run.outcome == RECORDING]
    return (*cut, *all_losses(found))


def records(fd: int) -> Iterator[tuple[int, Record, int]]:
    """(number, record, end in bytes) of every readable record."""
    for frame in frames(fd):
        try:
            yield frame.number, decode(frame.payload), frame.end
        except DataError:
            continue


def _take_heads(found: Survey, record: Record) -> None:
    for node in record.heads:
        run_id = _run_of(node.path)
        if run_id is None:
            known = found.session
        elif run_id in found.runs or {"protocol", "start_s", "duration_s"} <= set(node.attrs):
            known = found.runs.setdefault(run_id, RunFound()).head
        else:
            continue
        same = next((k for k, other in enumerate(known) if other.path == node.path), None)
        if same is None:
            known.append(node)
        elif node.texts and not known[same].texts:
            known[same] = node


def _count_rows(found: Survey, record: Record, received: dict[str, int], last_s: dict[str, float]) -> None:
    for node in record.nodes:
        received[node.path] = received.get(node.path, 0) + row_count(node)
        times = node.rows.get("time")
        run = found.runs.get(_run_of(node.path) or "")
        if times is not None and len(times):
            last_s[node.path] = found.last_s = float(times[-1])
            if run is not None:
                run.last_s = max(run.last_s, found.last_s)
        if run is None:
            continue
        if node.path.count("/") == 1 and "outcome" in node.attrs:
            run.outcome = str(node.attrs["outcome"])


def _hole(found: Survey, number: int, path: str, missing: int, before_s: float | None, record: Record) -> None:
    run = found.runs.get(_run_of(path) or "")
    parts = path.split("/")
    stream = parts[-1] if parts[-1] == "gaps" else parts[2] if parts[0] == "runs" and len(parts) > 2 else parts[0]
    words, counter = _STREAMS.get(stream, (path, ""))
    loss = message("{n} {stream} are missing", n=missing, stream=phrase(words))
    if run is None:
        found.losses.append(loss)
        return
    run.losses.append(loss)
    if not counter:
        return
    start_s, duration_s = _span(run)
    after_s = start_s + duration_s
    for node in record.nodes:
        if node.path == path and len(node.rows.get("time", _NO_TIMES)):
            after_s = float(node.rows["time"][0])
    if before_s is None:
        before_s = start_s
    gap = [before_s, max(before_s, after_s)]
    table = schema.TOUCH if stream == "touch" else schema.LASER
    found.holes.setdefault(number, []).append(Node(path, counts={counter: missing}, table=table))
    found.holes[number] += session_nodes.gap_node(path, np.array([gap]))


def _span(run: RunFound) -> tuple[float, float]:
    attrs = run.head[0].attrs if run.head else {}
    start_s, duration_s = attrs.get("start_s", 0.0), attrs.get("duration_s", 0.0)
    return float(start_s), float(duration_s)


def _run_of(path: str) -> str | None:
    parts = path.split("/")
    return parts[1] if len(parts) > 1 and parts[0] == "runs" else None


def _records_missing(first: int, last: int) -> str:
    return (
        message("record {first} is missing", first=first)
        if first == last
        else message("records {first} to {last} are missing", first=first, last=last)
    )
