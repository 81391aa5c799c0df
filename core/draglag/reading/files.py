"""The bytes of a regular file, up to a limit."""

from __future__ import annotations

import gzip
import os
import stat
import zlib
from io import BufferedIOBase, BytesIO
from pathlib import Path

import numpy as np

from draglag.errors import DataError, cause
from draglag.messages import message
from draglag.reading.limits import GZIP_FREE_BYTES, GZIP_RATIO, LINE_BYTES, TABLE_BYTES, TABLE_ROWS

_PIECE_BYTES = 2**20
_GZIP = b"\x1f\x8b"
# Without waiting for the other end of a pipe, and without becoming a terminal's process.
_CHECK = message("Check the name and the rights")
_FLAGS = os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK | os.O_NOCTTY


def read_bytes(path: Path | str, most: int, remedy: str = _CHECK) -> bytes:
    """The whole file. Raises DataError: missing, unreadable, a pipe or device, longer than ``most`` bytes."""
    try:
        _regular(path, os.stat(path).st_mode)  # before it is opened: opening alone moves some devices
        descriptor = os.open(path, _FLAGS)
        with os.fdopen(descriptor, "rb") as file:
            _regular(path, os.fstat(descriptor).st_mode)
            data = _up_to(file, most + 1)
    except OSError as error:
        raise DataError(message("{path}: cannot be read ({why})", path=path, why=cause(error)), remedy) from error
    except ValueError as error:  # a name that holds a NUL
        raise DataError(message("{path}: cannot be the name of a file", path=repr(str(path))), remedy) from error
    if len(data) > most:
        raise DataError(message("{path}: is longer than {size}", path=path, size=_size(most)), remedy)
    return data


def read_text(path: Path | str, most: int, remedy: str = _CHECK) -> str:
    """The whole file as UTF-8 text. Raises DataError."""
    return decoded(path, read_bytes(path, most, remedy))


def decoded(path: Path | str, data: bytes) -> str:
    """UTF-8 text without byte-order mark. Raises DataError."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        problem = message(
            "{path}, line {line}: is not UTF-8 text (byte {byte})", path=path, line=line, byte=error.start
        )
        raise DataError(problem, "Save it as UTF-8") from error


def plain_bytes(path: Path | str) -> bytes:
    """A recording, unpacked if gzipped. Raises DataError as ``read_bytes``, and for damaged gzip."""
    data = read_bytes(path, TABLE_BYTES, message("Check the file and its rights"))
    return _unpacked(path, data) if data[:2] == _GZIP or Path(path).suffix == ".gz" else data


def plain_lines(path: Path | str) -> bytes:
    """A table of lines, unpacked, line ends all newlines. Raises DataError."""
    data = plain_bytes(path).replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    ends = np.flatnonzero(np.frombuffer(data, np.uint8) == ord("\n"))
    if len(ends) > TABLE_ROWS:
        raise DataError(message("{path}: has more than {most} lines", path=path, most=TABLE_ROWS), "Split the run")
    lengths = np.diff(np.concatenate([[-1], ends, [len(data)]]))
    if lengths.max() > LINE_BYTES:
        line = int(np.argmax(lengths > LINE_BYTES)) + 1
        problem = message("{path}, line {line}: is longer than {most} bytes", path=path, line=line, most=LINE_BYTES)
        raise DataError(problem, "Expected numbers separated by commas, one record a line")
    return data


def _unpacked(path: Path | str, packed: bytes) -> bytes:
    most = min(TABLE_BYTES, GZIP_FREE_BYTES + GZIP_RATIO * len(packed))
    try:
        with gzip.GzipFile(fileobj=BytesIO(packed)) as file:
            data = _up_to(file, most + 1)
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise DataError(
            message("{path}: is not sound gzip ({error})", path=path, error=error), "Copy or compress it again"
        ) from error
    if len(data) > most:
        raise DataError(
            message("{path}: unpacks to more than {size}, as no table of numbers does", path=path, size=_size(most)),
            "Split the run",
        )
    return data


def _up_to(file: BufferedIOBase, most: int) -> bytes:
    """By pieces: Python allocates all bytes asked for, however short the file."""
    pieces: list[bytes] = []
    while most > 0 and (piece := file.read(min(most, _PIECE_BYTES))):
        pieces.append(piece)
        most -= len(piece)
    return b"".join(pieces)


def _regular(path: Path | str, mode: int) -> None:
    if stat.S_ISDIR(mode):
        raise DataError(message("{path}: is a folder", path=path), "Name a file in it")
    if not stat.S_ISREG(mode):
        raise DataError(
            message("{path}: is not a regular file", path=path), "Name a file on a disk, not a pipe or a device"
        )


def _size(count: int) -> str:
    return f"{count / 2**20:.0f} MiB" if count >= 2**20 else f"{count} bytes"
