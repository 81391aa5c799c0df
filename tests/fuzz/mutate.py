"""Inputs near those that a reader accepts: bytes changed, numbers and words replaced, pieces repeated and joined."""

from __future__ import annotations

import random
import re
from collections.abc import Sequence

MOST_BYTES = 8192  # of one input: longer ones are tried by the tests of the limits, a million of these take minutes
_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?")
_WORD = re.compile(rb"[A-Za-z_][A-Za-z_0-9]*")
NUMBERS = (
    b"0",
    b"-0",
    b"-1",
    b"1",
    b"2",
    b"1e308",
    b"-1e308",
    b"1e999",
    b"5e-324",
    b"nan",
    b"-inf",
    b"inf",
    b"NaN",
    b"Infinity",
    b"9223372036854775807",
    b"9223372036854775808",
    b"-9223372036854775809",
    b"4294967296",
    b"-2147483649",
    b"65536",
    b"340282366920938463463374607431768211456",
    b"9" * 400,
    b"9" * 5000,
    b"0x10",
    b"1_000",
    b"0.1",
    b"true",
    b'"1"',
    b"null",
    b"[]",
    b"{}",
    b"1e12",
    b"1e18",
    b"07",
    b"+1",
    b"\xd9\xa3",
)
PIECES = (
    b"\x00",
    b"\xff",
    b"\xef\xbb\xbf",
    b"\r",
    b"\n",
    b"\r\n",
    b",",
    b",,",
    b";",
    b'"',
    b'"""',
    b"'",
    b"#",
    b"=",
    b":",
    b".",
    b"\\u0000",
    b"\\ud800",
    b"[",
    b"]",
    b"[[",
    b"]]",
    b"{",
    b"}",
    b"[" * 50,
    b'{"a":' * 50,
    b"a." * 40,
    b" " * 200,
    b"<b>",
    b"../",
    b"/",
    b"x" * 300,
    "é€\U0001f600".encode(),
    b"E: 0.0 0000 0000 0",
    b"\x1f\x8b\x08\x00",
)


def mutated(data: bytes, others: Sequence[bytes], rng: random.Random) -> bytes:
    """The data after one to four changes, at most ``MOST_BYTES`` long."""
    for _ in range(rng.choice((1, 1, 1, 2, 2, 3, 4))):
        data = rng.choice(_CHANGES)(data, others, rng)
    return data[:MOST_BYTES]


def _flip(data: bytes, others: Sequence[bytes], rng: random.Random) -> bytes:
    if not data:
        return b"0"
    at = rng.randrange(len(data))
    return data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :]


def _insert(data: bytes, others: Sequence[bytes], rng: random.Random) -> bytes:
    at = rng.randint(0, len(data))
    return data[:at] + rng.choice(PIECES) + data[at:]


def _cut(data: bytes, others: Sequence[bytes], rng: random.Random) -> bytes:
    first, last = _span(data, rng)
    return data[:first] + data[last:]


def _repeat(data: bytes, others: Sequence[bytes], rng: random.Random) -> bytes:
    first, last = _span(data, rng)
    return data[:last] + data[first:last] * rng.choice((1, 1, 2, 20)) + data[last:]


def _number(data: bytes, others: Sequence[bytes], rng: random.Random) -> bytes:
    return _replace(_NUMBER, rng.choice(NUMBERS), data, rng)


def _word(data: bytes, others: Sequence[bytes], rng: random.Random) -> bytes:
    words = _WORD.findall(rng.choice(others))
    return _replace(_WORD, rng.choice(words) if words else b"x", data, rng)


def _line(data: bytes, others: Sequence[bytes], rng: random.Random) -> bytes:
    lines = data.split(b"\n")
    source = rng.choice(others).split(b"\n")
    lines.insert(rng.randint(0, len(lines)), rng.choice(source))
    if rng.random() < 0.5:
        del lines[rng.randrange(len(lines))]
    return b"\n".join(lines)


def _splice(data: bytes, others: Sequence[bytes], rng: random.Random) -> bytes:
    other = rng.choice(others)
    return data[: rng.randint(0, len(data))] + other[rng.randint(0, len(other)) :]


def _span(data: bytes, rng: random.Random) -> tuple[int, int]:
    first = rng.randint(0, len(data))
    return first, min(len(data), first + rng.choice((1, 2, 8, 64, 512)))


def _replace(pattern: re.Pattern[bytes], by: bytes, data: bytes, rng: random.Random) -> bytes:
    found = list(pattern.finditer(data[:MOST_BYTES]))
    if not found:
        return data + by
    place = rng.choice(found)
    return data[: place.start()] + by + data[place.end() :]


_CHANGES = (_flip, _insert, _cut, _repeat, _number, _number, _word, _line, _splice)
