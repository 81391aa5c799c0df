"""A disk in memory: a recording's file calls, and the disk's state at any moment.

Calls are taken from ``os`` itself, for files below one folder: nothing of the recording is replaced.
"""

from __future__ import annotations

import errno
import os
import random
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import pytest

PAGE = 4096
CALLS = ("open", "close", "pwrite", "ftruncate", "posix_fallocate", "fdatasync", "fsync", "link", "rename", "unlink",
         "pread")  # fmt: skip
REAL = {name: getattr(os, name) for name in CALLS}


@dataclass(frozen=True)
class Call:
    """``kind``: create, write, truncate, sync, sync_folder, link, rename, unlink, or mark (of the trial itself)."""

    kind: str
    name: str = ""
    other: str = ""
    at: int = 0
    data: bytes = b""
    file: int = -1


@dataclass
class Calls:
    """Every file call below a folder. ``fail``: number of the call that fails, and with which errno, for ``times``."""

    folder: Path
    log: list[Call] = field(default_factory=list)
    count: int = 0
    fail: int = -1
    times: int = 1
    error: int = errno.EIO
    names: list[str] = field(default_factory=list)
    _files: dict[int, int] = field(default_factory=dict)
    _ids: dict[str, int] = field(default_factory=dict)
    _next: int = 0

    def mark(self, text: str) -> None:
        self.log.append(Call("mark", text))

    def counts(self, name: str) -> None:
        """One more call; raises where it is the one to fail."""
        number, self.count = self.count, self.count + 1
        self.names.append(name)
        if self.fail <= number < self.fail + self.times and self.fail >= 0:
            raise OSError(self.error, os.strerror(self.error))


@contextmanager
def watched(folder: Path) -> Iterator[Calls]:
    """File calls below the folder are written down while this lasts."""
    calls = Calls(folder)
    with pytest.MonkeyPatch.context() as patch:
        for name, wrapped in _Wrapped(calls).all().items():
            patch.setattr(os, name, wrapped)
        yield calls


class _Wrapped:
    """The calls of ``os``, each counted and written down where it is of a file below the folder."""

    def __init__(self, calls: Calls) -> None:
        self.calls = calls

    def all(self) -> dict[str, Any]:
        resized = {name: partial(self.resize, name) for name in ("ftruncate", "posix_fallocate")}
        synced = {name: partial(self.sync, name) for name in ("fdatasync", "fsync")}
        named = {name: partial(self.rename, name) for name in ("link", "rename", "unlink")}
        ours = {"open": self.open, "close": self.close, "pwrite": self.pwrite, "pread": self.pread}
        return {**ours, **resized, **synced, **named}

    def inside(self, path: Any) -> str | None:
        try:
            relative = Path(path).absolute().relative_to(self.calls.folder)
        except (TypeError, ValueError):
            return None
        return relative.as_posix()

    def open(self, path: Any, flags: int, *more: Any, **options: Any) -> int:
        calls, name = self.calls, self.inside(path)
        if name is not None:
            calls.counts("open")
        fd: int = REAL["open"](path, flags, *more, **options)
        if name == ".":
            calls._files[fd] = -2
        elif name is not None:
            if flags & os.O_CREAT:
                calls._ids[name] = calls._next
                calls._next += 1
                calls.log.append(Call("create", name, file=calls._ids[name]))
            calls._files[fd] = calls._ids.get(name, -1)
        return fd

    def close(self, fd: int) -> None:
        self.calls._files.pop(fd, None)
        REAL["close"](fd)

    def counted(self, name: str, fd: int, *more: Any) -> tuple[Any, int | None]:
        """What a call of a descriptor returns, and the file that it is of; None for one elsewhere."""
        file = self.calls._files.get(fd)
        if file is not None:
            self.calls.counts(name)
        return REAL[name](fd, *more), file

    def pwrite(self, fd: int, data: Any, at: int) -> int:
        written, file = self.counted("pwrite", fd, data, at)
        if file is not None:
            self.calls.log.append(Call("write", at=at, data=bytes(data[:written]), file=file))
        return int(written)

    def pread(self, fd: int, length: int, at: int) -> bytes:
        return bytes(self.counted("pread", fd, length, at)[0])

    def resize(self, name: str, fd: int, *sizes: int) -> None:
        _, file = self.counted(name, fd, *sizes)
        if file is not None:
            self.calls.log.append(Call("truncate", at=os.fstat(fd).st_size, file=file))

    def sync(self, name: str, fd: int) -> None:
        _, file = self.counted(name, fd)
        if file is not None:
            self.calls.log.append(Call("sync_folder") if file == -2 else Call("sync", file=file))

    def rename(self, kind: str, source: Any, target: Any = None, **options: Any) -> None:
        name = self.inside(source)
        if name is not None:
            self.calls.counts(kind)
        REAL[kind](*([source] if target is None else [source, target]), **options)
        if name is None:
            return
        other = "" if target is None else self.inside(target) or ""
        self.calls.log.append(Call(kind, name, other))
        if other:
            self.calls._ids[other] = self.calls._ids[name]


@dataclass
class Disk:
    """Names, and the bytes of every file."""

    names: dict[str, int] = field(default_factory=dict)
    data: dict[int, bytearray] = field(default_factory=dict)

    def apply(self, call: Call, cut: int | None = None) -> None:
        """The call as the process sees it; of a write only the first ``cut`` bytes."""
        if call.kind == "create":
            self.names[call.name] = call.file
            self.data[call.file] = bytearray()
        elif call.kind == "unlink":
            self.names.pop(call.name, None)
        elif call.kind == "link":
            self.names[call.other] = self.names[call.name]
        elif call.kind == "rename":
            self.names[call.other] = self.names.pop(call.name)
        elif call.kind == "truncate":
            _resize(self.data[call.file], call.at)
        elif call.kind == "write":
            held, data = self.data[call.file], call.data if cut is None else call.data[:cut]
            _resize(held, max(len(held), call.at + len(data)))
            held[call.at : call.at + len(data)] = data

    def dump(self, folder: Path) -> None:
        """Write the files out, instead of what is in the folder."""
        for path in folder.iterdir():
            path.unlink()
        for name, file in self.names.items():
            (folder / name).write_bytes(self.data[file])


def after_power_cut(calls: list[Call], rng: random.Random, garbage: float = 0.0) -> Disk:
    """Possible contents of the disk after these calls and a power cut.

    Every page written since the last synchronisation is old or new (p = 0.5), or with probability ``garbage`` neither;
    of names changed since the folder was synchronised any number hold, in order; changed sizes are old, new or between.
    """
    seen, safe, dirty = Disk(), {}, {}
    safe_names: dict[str, int] = {}
    pending: list[dict[str, int]] = []
    for call in calls:
        if call.kind == "sync_folder":
            safe_names, pending = dict(seen.names), []
        elif call.kind == "sync":
            safe[call.file], dirty[call.file] = bytes(seen.data[call.file]), set()
        elif call.kind != "mark":
            seen.apply(call)
            if call.kind in ("create", "unlink", "link", "rename"):
                pending.append(dict(seen.names))
            elif call.kind == "write":
                last = (call.at + len(call.data) - 1) // PAGE
                dirty.setdefault(call.file, set()).update(range(call.at // PAGE, last + 1))
    kept = Disk(dict(rng.choice([safe_names, *pending])))
    for file in kept.names.values():
        kept.data[file] = _mixed(safe.get(file, b""), seen.data[file], dirty.get(file, set()), rng, garbage)
    return kept


def _mixed(old: bytes, new: bytearray, dirty: set[int], rng: random.Random, garbage: float) -> bytearray:
    size = len(new)
    if len(old) != len(new) and rng.random() < 0.3:
        size = rng.randint(min(len(old), len(new)), max(len(old), len(new)))
    mixed = bytearray(old[:size])
    _resize(mixed, size)
    for page in sorted(dirty):
        start, end = page * PAGE, min((page + 1) * PAGE, size, len(new))
        if start < end and rng.random() < garbage:
            mixed[start:end] = rng.randbytes(end - start)
        elif start < end and rng.random() < 0.5:
            mixed[start:end] = new[start:end]
    return mixed


def _resize(data: bytearray, size: int) -> None:
    if len(data) > size:
        del data[size:]
    else:
        data.extend(bytes(size - len(data)))
