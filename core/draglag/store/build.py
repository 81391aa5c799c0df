"""A session file made whole: nodes → temporary HDF5 → disk → its name."""

from __future__ import annotations

import errno
import io
import os
import uuid
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import h5py

from draglag.errors import DataError
from draglag.messages import Message, message, phrase
from draglag.recording import Session
from draglag.store import schema, session_nodes
from draglag.store.checksum import raw_checksum
from draglag.store.frames import lock, sync_folder
from draglag.store.lowlevel import put_attrs, put_node
from draglag.store.nexus import mark
from draglag.store.nodes import merged, row_count, separate
from draglag.store.safely import BROKEN
from draglag.store.schema import Node
from draglag.system.temporary import publish, refuse

# Rows that are merged before they are written: chunks of HDF5 are then filled at once.
_BATCH_ROWS = 1 << 16
# An HDF5 file of many small tables holds up to this many bytes for each byte of its columns (measured: 1.1 to 1.25) …
_OVERHEAD = 1.3
# … and so many for its groups and attributes, one run (bytes; measured: 45 kB).
_BASE = 1 << 20
_RUN_BYTES = 1 << 16
TEMPORARY = ".tmp"


def write_session(session: Session, path: Path | str) -> Path:
    """The path of the new session file. Raises DataError; never overwrites."""
    ids = [run.id for run in session.runs]
    twice = next((run_id for k, run_id in enumerate(ids) if run_id in ids[:k]), None)
    if twice is not None:
        raise DataError(
            message("{path}: there are two runs “{run}”", path=path, run=twice), "Give every run an id of its own"
        )
    owners: dict[str, schema.Value] = {}
    nodes = [separate(node, owners) for node in session_nodes.session_nodes(session)]
    bytes_ = sum(getattr(values, "nbytes", 0) for node in nodes for values in node.rows.values())
    return build(nodes, Path(path), bytes_ + _RUN_BYTES * len(ids))


def build(nodes: Iterable[Node], out: Path, size: int) -> Path:
    """The path of a new file, which appears whole or not at all.

    Args:
        nodes: the root first; a run's attributes before its tables.
        size: approximate bytes of the columns.

    Raises DataError: the name is taken, no such folder, or no room.
    """
    refuse(out)
    temporary = out.with_name(f".{out.name}.{uuid.uuid4().hex[:8]}{TEMPORARY}")
    try:
        fd = os.open(temporary, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
    except OSError as error:
        raise DataError(
            message("{path}: cannot be made ({why})", path=out, why=reason(error)), "Choose a folder you may write"
        ) from error
    try:
        lock(fd)  # so that nobody takes it for a leftover
        _write(nodes, fd, int(_OVERHEAD * size) + _BASE, out)
        publish(temporary, out)
        sync_folder(out.absolute().parent)
    except OSError as error:
        full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        remedy = message("Make room there, or choose another place" if full else "Choose another place")
        raise DataError(message("{path}: cannot be written ({why})", path=out, why=reason(error)), remedy) from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        os.close(fd)
    return out


def fill(file: Any, nodes: Iterable[Node]) -> None:
    """Write nodes and their checksum into an empty HDF5 file."""
    started = _Started()
    for batch in _batches(nodes):
        for node in merged(batch):
            started.register(node)
            put_node(file, node, started.zero_utc())
    # A journal may be older than the layout that is written.
    put_attrs(file, {"schema_version": schema.VERSION})
    mark(file)
    put_attrs(file, {"raw_sha256": raw_checksum(file)})


def zero_utc(started_utc: str, started_s: float | None) -> str:
    """ISO 8601 of the host clock's zero, if known."""
    try:
        return (datetime.fromisoformat(started_utc) - timedelta(seconds=started_s or 0.0)).isoformat()
    except (ValueError, OverflowError):
        return ""


def reason(error: BaseException) -> Message:
    """Why something could not be written."""
    if isinstance(error, OSError) and error.errno:
        return phrase(os.strerror(error.errno))
    return phrase(" ".join(str(error).split())[:200])


@contextmanager
def safe_hdf5(fd: int, mode: str, room: int, where: Path) -> Iterator[tuple[Any, Callable[[], bool]]]:
    """Yields an HDF5 file, on disk when the block ends, and a function: has the disk failed?

    HDF5 (1.14) ends the process when a write fills the disk: so ``room`` (bytes) is reserved first, errors are raised
    later. Raises OSError, and DataError for what HDF5 does not take.
    """
    size = os.fstat(fd).st_size
    _take_room(fd, size + room)
    target = _Target(fd, 0 if mode == "w" else size)
    try:
        with h5py.File(target, mode) as file:
            yield file, lambda: target.error is not None
    except BROKEN as error:
        if target.error is None and not isinstance(error, OSError):
            raise DataError(
                message("{path}: cannot be made from what it shall hold ({why})", path=where, why=reason(error))
            ) from error
        raise target.error or error from error
    if target.error is not None:
        raise target.error
    os.ftruncate(fd, target.size)
    os.fsync(fd)


def _write(nodes: Iterable[Node], fd: int, room: int, out: Path) -> None:
    with safe_hdf5(fd, "w", room, out) as (file, failed):
        fill(file, _until(nodes, failed))


def _take_room(fd: int, size: int) -> None:
    try:
        os.posix_fallocate(fd, 0, size)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.EOPNOTSUPP):
            raise
        disk = os.fstatvfs(fd)  # a file system that cannot: at least it shall have so much
        if disk.f_bavail * disk.f_frsize < size:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)) from None


def _until(nodes: Iterable[Node], ended: Callable[[], bool]) -> Iterator[Node]:
    for node in nodes:
        if ended():
            return
        yield node


class _Target(io.RawIOBase):
    """A descriptor as a file for HDF5, which never sees its ``error``."""

    def __init__(self, fd: int, size: int = 0) -> None:
        self._fd = fd
        self._at = 0
        self.size = size
        self.error: OSError | None = None

    def seek(self, offset: int, whence: int = os.SEEK_SET, /) -> int:
        self._at = offset + {os.SEEK_SET: 0, os.SEEK_CUR: self._at, os.SEEK_END: self.size}[whence]
        return self._at

    def tell(self) -> int:
        return self._at

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def readinto(self, buffer: Any, /) -> int:
        view = memoryview(buffer).cast("B")
        count = max(0, min(len(view), self.size - self._at))
        got = self._try(lambda: os.preadv(self._fd, [view[:count]], self._at)) if count else 0
        self._at += got
        return got

    def write(self, data: Any, /) -> int:
        view = memoryview(data).cast("B")
        done = 0
        while done < len(view) and self.error is None:
            rest, at = view[done:], self._at + done
            done += self._try(lambda rest=rest, at=at: os.pwrite(self._fd, rest, at))  # type: ignore[misc]
        self._at += len(view)
        self.size = max(self.size, self._at)
        return len(view)

    def truncate(self, size: int | None = None, /) -> int:
        """The reserved room is kept until the file is whole."""
        self.size = self._at if size is None else size
        return self.size

    def _try(self, action: Callable[[], int]) -> int:
        try:
            return action()
        except OSError as error:
            self.error = self.error or error
            return 0


class _Started:
    def __init__(self) -> None:
        self._utc = ""
        self._s: float | None = None

    def register(self, node: Node) -> None:
        if node.path == "":
            self._utc = str(node.attrs.get("started_utc", self._utc))
        # Where nobody noted the host's clock, the session begins with its first run.
        key = "started_s" if node.path == "" else "start_s"
        if self._s is None and isinstance(node.attrs.get(key), float):
            self._s = float(node.attrs[key])

    def zero_utc(self) -> str:
        return zero_utc(self._utc, self._s)


def _batches(nodes: Iterable[Node]) -> Iterator[list[Node]]:
    waiting: list[Node] = []
    rows = 0
    for node in nodes:
        waiting.append(node)
        rows += row_count(node)
        if rows >= _BATCH_ROWS:
            yield waiting
            waiting, rows = [], 0
    if waiting:
        yield waiting
