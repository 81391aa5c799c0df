"""Chunks of an XDF file (1.0), checked before pyxdf allocates what they claim."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import isfinite
from xml.etree.ElementTree import Element, ParseError, fromstring

import numpy as np

from draglag.errors import DataError
from draglag.messages import message
from draglag.reading.limits import HEADER_BYTES, TABLE_ROWS, TIME_S

_MAGIC = b"XDF:"
_FILE_HEAD, _STREAM_HEAD, _SAMPLES, _CLOCK, _BOUNDARY, _FOOT = range(1, 7)
# After it a new chunk begins, whatever was damaged before (the specification's UUID of boundary chunks).
_BOUNDARY_MARK = bytes.fromhex("43a546dccbf5410fb30ed5467383cbe4")
_LENGTHS = {1: "<B", 4: "<I", 8: "<Q"}
_NUMBERS = {"double64": 8, "float32": 4, "int64": 8, "int32": 4, "int16": 2, "int8": 1}
"""Bytes of a number of each format; streams of texts hold no touch and no light."""
_STAMP = 8
# Of the clock of one stream: pyxdf fits each piece between two of them, for 0.1 s. Each is a restart of a computer.
_MOST_RESETS = 100
# A comparison of clocks that is earlier than the one before, or whose offset differs by more (s), may be a reset.
_RESET_S = 1.0


class _Damaged(Exception):
    """A malformed chunk."""


@dataclass
class Chunks:
    """``data``: an XDF file of the sound chunks; ``damaged``: number of others."""

    data: bytes = b""
    damaged: int = 0
    sample_bytes: dict[int, int | None] = field(default_factory=dict)
    clocks: dict[int, tuple[float, float]] = field(default_factory=dict)
    samples: int = 0
    resets: int = 0


def sound_chunks(data: bytes, where: str) -> Chunks:
    """The sound chunks of a file. Raises DataError: no XDF file, or longer than any recording."""
    if data[: len(_MAGIC)] != _MAGIC:
        raise DataError(message("{path}: is not an XDF file", path=where), "Name the format with --format")
    found, kept = Chunks(), [_MAGIC]
    for number, chunk in enumerate(_chunks(data, found)):
        try:
            if _sound(*chunk, found):
                kept.append(_whole(*chunk))
        except (_Damaged, struct.error):
            found.damaged += 1
        if max(number, found.samples) > TABLE_ROWS:
            raise DataError(
                message("{path}: has more than {most} samples or chunks", path=where, most=TABLE_ROWS),
                "Split the recording",
            )
        if found.resets > _MOST_RESETS:
            raise DataError(
                message("{path}: its clocks were set more than {most} times", path=where, most=_MOST_RESETS),
                "Record again",
            )
    found.data = b"".join(kept)
    return found


def _chunks(data: bytes, found: Chunks) -> Iterator[tuple[int, bytes]]:
    """(tag, content) of each chunk; after an impossible length, from the next boundary."""
    at = len(_MAGIC)
    while at < len(data):
        try:
            length, begin = _length(data, at)
            at = begin + length
            if length < 2 or at > len(data):
                raise _Damaged
        except (_Damaged, struct.error):
            found.damaged += 1
            mark = data.find(_BOUNDARY_MARK, begin if at > len(data) else at)
            if mark < 0:
                return
            at = mark + len(_BOUNDARY_MARK)
        else:
            yield struct.unpack_from("<H", data, begin)[0], data[begin + 2 : at]


def _length(data: bytes, at: int) -> tuple[int, int]:
    size = data[at] if at < len(data) else 0
    if size not in _LENGTHS:
        raise _Damaged
    return int(struct.unpack_from(_LENGTHS[size], data, at + 1)[0]), at + 1 + size


def _whole(tag: int, content: bytes) -> bytes:
    return struct.pack("<BQH", 8, len(content) + 2, tag) + content


def _sound(tag: int, content: bytes, found: Chunks) -> bool:
    if tag == _FILE_HEAD:
        _xml(content)
        return True
    if tag not in (_STREAM_HEAD, _SAMPLES, _CLOCK, _FOOT):
        return False
    (stream,) = struct.unpack_from("<I", content)
    content = content[4:]
    if (tag == _STREAM_HEAD) == (stream in found.sample_bytes):  # begun twice, or continued without a beginning
        raise _Damaged
    if tag == _STREAM_HEAD:
        found.sample_bytes[stream] = _sample_bytes(_xml(content))
    size = found.sample_bytes[stream]
    if size is None:
        return False
    if tag == _SAMPLES:
        found.samples += _checked_samples(content, size)
    elif tag == _CLOCK:
        _follow_clock(stream, content, found)
    elif tag == _FOOT:
        _xml(content)
    return True


def _xml(content: bytes) -> Element:
    """A document without entity definitions, which could grow without bound."""
    if len(content) > HEADER_BYTES or b"<!" in content or b"\0" in content:
        raise _Damaged
    try:
        return fromstring(content.decode("utf-8"))
    except (ParseError, ValueError) as error:
        raise _Damaged from error


def _sample_bytes(head: Element) -> int | None:
    kind = head.findtext("channel_format", "")
    if head.tag != "info" or head.find("name") is None or kind not in (*_NUMBERS, "string"):
        raise _Damaged
    try:
        channels, rate_hz = int(head.findtext("channel_count", "")), float(head.findtext("nominal_srate", ""))
    except ValueError as error:
        raise _Damaged from error
    if channels < 1 or not 0 <= rate_hz < np.inf:
        raise _Damaged
    return channels * _NUMBERS[kind] if kind in _NUMBERS else None


def _checked_samples(content: bytes, size: int) -> int:
    """Number of samples, each a byte (0, or 8 and a stamp) and numbers."""
    count, at = _length(content, 0)
    body = np.frombuffer(content, np.uint8)[at:]
    for stamp, step in ((_STAMP, 1 + _STAMP + size), (0, 1 + size)):  # all of one kind, as is usual
        if len(body) == count * step and (body[::step] == stamp).all():
            return count
    place = 0
    for _ in range(count):
        if place >= len(body) or body[place] not in (0, _STAMP):
            raise _Damaged
        place += 1 + int(body[place]) + size
    if place != len(body):
        raise _Damaged
    return count


def _follow_clock(stream: int, content: bytes, found: Chunks) -> None:
    if len(content) != 2 * _STAMP:
        raise _Damaged
    t_s, offset_s = struct.unpack("<dd", content)
    if not all(isfinite(value) and abs(value) <= TIME_S for value in (t_s, offset_s)):
        raise _Damaged
    before_s, offset_before_s = found.clocks.get(stream, (t_s, offset_s))
    found.resets += t_s < before_s or abs(offset_s - offset_before_s) > _RESET_S
    found.clocks[stream] = (t_s, offset_s)
