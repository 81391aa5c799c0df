"""Files that grow in a temporary folder next to their place."""

from __future__ import annotations

import fcntl
import os
import re
import shutil
import stat
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from draglag.errors import DataError
from draglag.messages import message

_NAME = re.compile(r"\.draglag-tmp-(\d+)-(\d+)-[0-9a-f]{8}")


@contextmanager
def temporary_for(path: Path) -> Iterator[Path]:
    """A path in a new, locked temporary folder, to be renamed to ``path`` before the block ends."""
    number = os.getpid()
    folder = path.absolute().parent / f".draglag-tmp-{number}-{_started(number)}-{uuid.uuid4().hex[:8]}"
    folder.mkdir()
    descriptor = -1
    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
        with suppress(OSError):  # a file system without locks: the process's number alone says that it is in use
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield folder / path.name
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        if descriptor >= 0:
            os.close(descriptor)


@contextmanager
def new_file(path: Path | str, replace: bool = False) -> Iterator[Path]:
    """A place to write at; the file gets its name at the end of the block, whole or not at all.

    ``replace``: overwrite; a link stays a link. Raises OSError, and DataError as ``refuse``.
    """
    path = Path(path).resolve() if replace else Path(path)
    if not replace:
        refuse(path)
    with temporary_for(path) as growing:
        yield growing
        if replace:
            os.replace(growing, path)
        else:
            publish(growing, path)


def publish(source: Path, target: Path) -> None:
    """Give a finished file its name, atomically. Raises DataError if it is taken, OSError."""
    try:
        os.link(source, target)
    except FileExistsError as error:
        raise DataError(
            message("{path}: exists already and is not overwritten", path=target), "Choose another name"
        ) from error
    except OSError:  # a file system without hard links
        refuse(target)
        source.rename(target)
    else:
        source.unlink()


def refuse(path: Path, remedy: str = "Choose another name") -> None:
    """Raise DataError if the name is taken, with that remedy, or its folder missing."""
    if path.is_symlink() or path.exists():
        raise DataError(message("{path}: exists already and is not overwritten", path=path), remedy)
    folder = path.absolute().parent
    if not folder.is_dir():
        raise DataError(message("{path}: there is no such folder", path=folder), "Make it first, or choose another")


def sweep(folder: Path) -> list[Path]:
    """Temporary folders of ended processes, removed; those locked or of other accounts stay."""
    try:
        found = [name for name in os.listdir(folder) if _NAME.fullmatch(name)]
    except OSError:
        return []
    return [folder / name for name in found if _removed(folder / name)]


def _removed(path: Path) -> bool:
    number, started = _NAME.fullmatch(path.name).groups()  # type: ignore[union-attr]
    if _started(int(number)) == int(started) != 0:
        return False
    with suppress(OSError):
        descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
        try:
            status = os.fstat(descriptor)
            if status.st_uid != os.geteuid() or not stat.S_ISDIR(status.st_mode):
                return False
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(path)
            return True
        finally:
            os.close(descriptor)
    return False


def _started(number: int) -> int:
    """Clock ticks since boot; 0 if unknown."""
    try:
        status = Path(f"/proc/{number}/stat").read_bytes()
    except OSError:
        return 0
    return int(status.rpartition(b")")[2].split()[19])
