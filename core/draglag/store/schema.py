"""Names, units and order of every column of a session file. Layout: docs/session-file.md."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from draglag.errors import DataError
from draglag.messages import message

SCHEMA = "draglag-session"
VERSION = 2
TEXT_BYTES = 256
RAW_GROUPS = ("screen", "stylus", "beam", "devices", "details", "calibration", "clocks", "taps", "notes", "runs")

TEXTS = {
    "protocol_toml": "the protocol of the session, TOML",
    "options_json": "what the analysis was asked to do",
    "result_json": "the result as `draglag analyze --json` prints it",
}
"""Long texts, stored as scalar datasets → meaning."""

Value = float | int | str
_RUN_ID = re.compile(r"[A-Za-z0-9][A-Za-z0-9 _.\-]{0,99}\Z")


@dataclass(frozen=True)
class Column:
    """One dataset. ``kind``: "f" (float64), "i" (int64), "S<n>" (n bytes of UTF-8). ``fill``: for missing rows."""

    name: str
    kind: str
    units: str
    meaning: str
    optional: bool = False

    @property
    def fill(self) -> float | int | bytes:
        if self.kind == "f":
            return float("nan")
        return b"" if self.kind.startswith("S") else -1

    @property
    def dtype(self) -> str:
        return {"f": "<f8", "i": "<i8"}.get(self.kind, self.kind)


@dataclass(frozen=True)
class Table:
    """Columns over one dimension scale; of kind "i", it counts rows."""

    scale: Column
    columns: tuple[Column, ...]
    chunk: int

    def every(self) -> tuple[Column, ...]:
        return (self.scale, *self.columns)


@dataclass(frozen=True)
class Node:
    """One HDF5 group: attributes to set, counters to add, long texts, rows to append."""

    path: str
    attrs: Mapping[str, Value] = field(default_factory=dict)
    counts: Mapping[str, int] = field(default_factory=dict)
    texts: Mapping[str, str] = field(default_factory=dict)
    table: Table | None = None
    rows: Mapping[str, NDArray[Any]] = field(default_factory=dict)


def _index(name: str, meaning: str) -> Column:
    return Column(name, "i", "1", meaning)


_TIME = Column("time", "f", "s", "time on the host's clock")
_DEVICE = Column("device_s", "f", "s", "time on the device's own clock", optional=True)
_EPOCH = Column("epoch", "i", "1", "counts restarts of the device's clock", optional=True)
_X = Column("x_mm", "f", "mm", "position across the screen, from its left edge")
_Y = Column("y_mm", "f", "mm", "position down the screen, from its top edge")

TOUCH = Table(
    _TIME,
    (
        _X,
        _Y,
        Column("contact_id", "i", "1", "the kernel's tracking id; a change marks a new contact", optional=True),
        Column("x_raw", "f", "1", "position across as the device reported it, device units", optional=True),
        Column("y_raw", "f", "1", "position down as the device reported it, device units", optional=True),
        _DEVICE,
    ),
    chunk=1024,
)
LASER = Table(
    _TIME,
    (Column("light", "i", "1", "1 = from here on the beam is on the sensor, 0 = dark"), _DEVICE, _EPOCH),
    chunk=256,
)
DISPLAY = Table(_TIME, (_X, _Y), chunk=1024)
GAPS = Table(
    _index("gap", "number of the gap"),
    (
        Column("start_s", "f", "s", "from here the stream is known to be incomplete"),
        Column("end_s", "f", "s", "from here it is complete again"),
    ),
    chunk=16,
)
AXES = Table(
    _index("axis", "number of the axis"),
    (
        Column("name", "S64", "1", "name of the axis"),
        Column("minimum", "i", "1", "smallest value, device units"),
        Column("maximum", "i", "1", "largest value, device units"),
        Column("resolution", "i", "1/mm", "device units per mm, 0 = unknown"),
        Column("fuzz", "i", "1", "the kernel's noise filter, device units"),
    ),
    chunk=8,
)
CALIBRATION = Table(
    _index("target", "number of the target"),
    (
        Column("x_raw", "f", "1", "where the touch was reported across, device units"),
        Column("y_raw", "f", "1", "where the touch was reported down, device units"),
        Column("x_mm", "f", "mm", "where the target was, from the screen's left edge"),
        Column("y_mm", "f", "mm", "where the target was, from the screen's top edge"),
    ),
    chunk=16,
)
AFFINE = ("xx", "xy", "x0_mm", "yx", "yy", "y0_mm")
"""Attributes of a calibration: x_mm = xx·x_raw + xy·y_raw + x0_mm, y_mm = yx·x_raw + yy·y_raw + y0_mm."""
CLOCK = Table(
    _index("observation", "number of the observation"),
    (
        Column("device_s", "f", "s", "time on the device's own clock"),
        Column("host_min_s", "f", "s", "earliest host time it can have been"),
        Column("host_max_s", "f", "s", "latest host time it can have been"),
        _EPOCH,
    ),
    chunk=256,
)
TAPS = Table(
    _index("tap", "number of the tap"),
    (
        Column("physical_s", "f", "s", "physical contact or release, host clock"),
        Column("registered_s", "f", "s", "registered event, host clock"),
        Column("down", "i", "1", "1 = touch, 0 = release"),
    ),
    chunk=128,
)
LOG = Table(
    _index("entry", "number of the row"),
    (
        Column("time_s", "f", "s", "time on the host's clock"),
        Column("level", "S16", "1", "info, warning, error or note"),
        Column("source", "S64", "1", "source of the entry"),
        Column("part", "i", "1", "0 = a new entry, 1, 2 … = the text before goes on"),
        Column("text", f"S{TEXT_BYTES}", "1", "what happened"),
    ),
    chunk=32,
)


def check_run_id(run_id: str, where: str) -> str:
    """The id. Raises DataError if it cannot name a group and a file."""
    if not _RUN_ID.match(run_id) or run_id != run_id.strip() or ".." in run_id:
        raise DataError(
            message("{path}: “{run}” cannot be the id of a run", path=where, run=run_id[:100]),
            "Use letters, digits, blanks, dots, - and _ only",
        )
    return run_id


def slug(name: str) -> str:
    """A group name that any reader can address."""
    return re.sub(r"[^A-Za-z0-9_.\-]+", "_", name).strip("._") or "unnamed"


def as_text(value: str) -> str:
    """Text without NUL, of valid Unicode."""
    return value.replace("\0", " ").encode("utf-8", "replace").decode("utf-8")


def cut_text(text: str, limit: int) -> list[str]:
    """Pieces of at most ``limit`` bytes of UTF-8, cut between characters."""
    parts: list[str] = []
    rest = as_text(text).encode()
    while len(rest) > limit:
        end = limit
        while end > 0 and (rest[end] & 0xC0) == 0x80:
            end -= 1
        parts.append(rest[:end].decode())
        rest = rest[end:]
    return [*parts, rest.decode()]


def encode(column: Column, values: Iterable[str]) -> NDArray[Any]:
    """Fixed-length UTF-8, cut between characters where too long."""
    limit = int(column.kind[1:])
    return np.array([cut_text(value, limit)[0].encode() for value in values], dtype=column.kind)
