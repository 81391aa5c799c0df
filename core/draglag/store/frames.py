"""An append-only file of checksummed frames: a recording in progress."""

from __future__ import annotations

import errno
import fcntl
import os
import struct
import zlib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

MAGIC = b"\xd7DLJ"
_HEAD = struct.Struct("<4s8sIII")
# What file systems and disks write as one piece (bytes).
PAGE = 4096
# A record holds 0.2 s of samples, some kB; more than this (bytes) is no record, whatever its length says.
LIMIT = 1 << 26
_COPY_BYTES = 1 << 20


class Locked(Exception):
    """Another process holds the file."""


@dataclass(frozen=True)
class Frame:
    """One whole frame; ``end``: where its payload ends, bytes.

    Little-endian: magic 4, nonce 8, number u32, length u32, CRC-32 u32 (of nonce, number, length, payload), payload,
    zeros up to the next page. The nonce excludes frames of older files left on the disk.
    """

    number: int
    payload: bytes
    end: int


class FrameFile:
    """A new, locked file. Raises OSError, Locked."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.count = 0
        self._end = 0
        self._nonce = os.urandom(8)
        self.fd = _create(path)

    @property
    def size(self) -> int:
        """Bytes that hold whole frames."""
        return self._end

    def append(self, payload: bytes) -> None:
        """Put a frame on the disk. Raises OSError; the file is then unchanged."""
        head = _HEAD.pack(MAGIC, self._nonce, self.count, len(payload), _crc(self._nonce, self.count, payload))
        data = head + payload + bytes(-(_HEAD.size + len(payload)) % PAGE)
        try:
            _write(self.fd, data, self._end)
            os.fdatasync(self.fd)
        except OSError:
            with suppress(OSError):  # what is left over is no whole frame, or is overwritten by the next
                os.ftruncate(self.fd, self._end)
            raise
        self._end += len(data)
        self.count += 1

    def in_place(self) -> bool:
        """Whether the path still names this file."""
        return _named(self.path, self.fd)

    def move(self, path: Path) -> None:
        """Go on in a new file with all frames. Raises OSError, Locked."""
        fd = _create(path)
        try:
            at = 0
            while at < self._end:
                piece = os.pread(self.fd, min(_COPY_BYTES, self._end - at), at)
                if not piece:
                    raise OSError(errno.EIO, os.strerror(errno.EIO), str(self.path))
                _write(fd, piece, at)
                at += len(piece)
            os.fdatasync(fd)
        except OSError:
            os.close(fd)
            path.unlink(missing_ok=True)
            raise
        old, self.fd = self.fd, fd
        if _named(self.path, old):
            with suppress(OSError):  # a second copy of what is safe elsewhere
                self.path.unlink()
        os.close(old)
        self.path = path

    def close(self) -> None:
        """Unlock explicitly, as a forked child would keep the lock, and close."""
        with suppress(OSError):
            fcntl.flock(self.fd, fcntl.LOCK_UN)
        os.close(self.fd)


def lock(fd: int) -> bool:
    """True once locked; False where the file system has no locks. Raises Locked.

    flock: POSIX locks end when any descriptor of the file is closed.
    """
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise Locked from None
    except OSError:
        return False
    return True


def sync_folder(folder: Path) -> None:
    """Make names in the folder survive a power cut. Raises OSError."""
    fd = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(fd)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.EOPNOTSUPP):  # a file system that cannot
            raise
    finally:
        os.close(fd)


def frames(fd: int) -> Iterator[Frame]:
    """Whole frames by number, each once."""
    places, nonce = _places(fd)
    size = os.fstat(fd).st_size
    for number in sorted(places):
        found = _frame(fd, places[number], size, nonce)
        if found is not None and found[1].number == number:
            yield found[1]


def _places(fd: int) -> tuple[dict[int, int], bytes | None]:
    size = os.fstat(fd).st_size
    places: dict[int, int] = {}
    at, nonce = 0, None
    while at + _HEAD.size <= size:
        found = _frame(fd, at, size, nonce)
        if found is None:
            at += PAGE
            continue
        nonce, frame = found
        places.setdefault(frame.number, at)
        at = frame.end + -frame.end % PAGE
    return places, nonce


def bytes_after(fd: int, end: int) -> int:
    """Bytes of an incomplete frame after the payload up to ``end``."""
    return max(0, os.fstat(fd).st_size - (end + -end % PAGE))


def _frame(fd: int, at: int, size: int, nonce: bytes | None) -> tuple[bytes, Frame] | None:
    head = _read(fd, _HEAD.size, at)
    if len(head) < _HEAD.size:
        return None
    magic, its, number, length, crc = _HEAD.unpack(head)
    if magic != MAGIC or nonce not in (None, its) or length > min(LIMIT, size - at - _HEAD.size):
        return None
    payload = _read(fd, length, at + _HEAD.size)
    if len(payload) != length or _crc(its, number, payload) != crc:
        return None
    return its, Frame(number, payload, at + _HEAD.size + length)


def _named(path: Path, fd: int) -> bool:
    try:
        named, opened = os.stat(path), os.fstat(fd)
    except OSError:
        return False
    return (named.st_dev, named.st_ino) == (opened.st_dev, opened.st_ino)


def _create(path: Path) -> int:
    fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
    try:
        lock(fd)
        sync_folder(path.absolute().parent)
    except BaseException:
        os.close(fd)
        path.unlink(missing_ok=True)
        raise
    return fd


def _write(fd: int, data: bytes, at: int) -> None:
    rest = memoryview(data)
    while rest:
        written = os.pwrite(fd, rest, at)
        at, rest = at + written, rest[written:]


def _read(fd: int, length: int, at: int) -> bytes:
    parts: list[bytes] = []
    while length > 0:
        try:
            piece = os.pread(fd, length, at)
        except OSError:
            break
        if not piece:
            break
        parts.append(piece)
        at, length = at + len(piece), length - len(piece)
    return b"".join(parts)


def _crc(nonce: bytes, number: int, payload: bytes) -> int:
    return zlib.crc32(payload, zlib.crc32(nonce + struct.pack("<II", number, len(payload))))
