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
from pathlib import Path
from typing import Any

import pytest

PAGE = 4096


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
        for name, wrapped in _wrappers(calls).items():
            patch.setattr(os, name, wrapped)
        yield calls


def _wrappers(calls: Calls) -> dict[str, Any]:
    real = {n: getattr(os, n) for n in ("open", "close", "pwrite", "ftruncate", "posix_fallocate", "fdatasync",
                                        "fsync", "link", "rename", "unlink", "pread")}  # fmt: skip
    files, ids, log = calls._files, calls._ids, calls.log

    def inside(path: Any) -> str | None:
        try:
            relative = Path(path).absolute().relative_to(calls.folder)
        except (TypeError, ValueError):
            return None
        return relative.as_posix()

    def open_(path: Any, flags: int, *more: Any, **options: Any) -> int:
        name = inside(path)
        if name is not None:
            calls.counts("open")
        fd: int = real["open"](path, flags, *more, **options)
        if name is not None and name != ".":
            if flags & os.O_CREAT:
                ids[name] = calls._next
                calls._next += 1
                log.append(Call("create", name, file=ids[name]))
            files[fd] = ids.get(name, -1)
        elif name == ".":
            files[fd] = -2
        return fd

    def close(fd: int) -> None:
        files.pop(fd, None)
        real["close"](fd)

    def pwrite(fd: int, data: Any, at: int) -> int:
        if fd in files:
            calls.counts("pwrite")
        written: int = real["pwrite"](fd, data, at)
        if fd in files:
            log.append(Call("write", at=at, data=bytes(data[:written]), file=files[fd]))
        return written

    def resize(name: str) -> Any:
        def call(fd: int, *sizes: int) -> None:
            if fd in files:
                calls.counts(name)
            real[name](fd, *sizes)
            if fd in files:
                log.append(Call("truncate", at=os.fstat(fd).st_size, file=files[fd]))

        return call

    def sync(name: str) -> Any:
        def call(fd: int) -> None:
            if fd in files:
                calls.counts(name)
            real[name](fd)
            if fd in files:
                log.append(Call("sync_folder") if files[fd] == -2 else Call("sync", file=files[fd]))

        return call

    def naming(kind: str) -> Any:
        def call(source: Any, target: Any = None, **options: Any) -> None:
            name = inside(source)
            if name is not None:
                calls.counts(kind)
            real[kind](*([source] if target is None else [source, target]), **options)
            if name is not None:
                other = "" if target is None else inside(target) or ""
                log.append(Call(kind, name, other))
                if other:
                    ids[other] = ids[name]

        return call

    def pread(fd: int, length: int, at: int) -> bytes:
        if fd in files:
            calls.counts("pread")
        got: bytes = real["pread"](fd, length, at)
        return got

    return {
        "open": open_, "close": close, "pwrite": pwrite, "pread": pread, "ftruncate": resize("ftruncate"),
        "posix_fallocate": resize("posix_fallocate"), "fdatasync": sync("fdatasync"), "fsync": sync("fsync"),
        "link": naming("link"), "rename": naming("rename"), "unlink": naming("unlink"),
    }  # fmt: skip


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
