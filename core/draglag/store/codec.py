"""Records of a journal as bytes: a JSON head, then little-endian columns."""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from draglag.errors import DataError
from draglag.store import schema
from draglag.store.schema import Node, Table, Value

TABLES: dict[str, Table] = {
    "touch": schema.TOUCH,
    "laser": schema.LASER,
    "display": schema.DISPLAY,
    "gaps": schema.GAPS,
    "axes": schema.AXES,
    "calibration": schema.CALIBRATION,
    "clock": schema.CLOCK,
    "taps": schema.TAPS,
    "log": schema.LOG,
}
_NAMES = {id(table): name for name, table in TABLES.items()}
_LENGTH = struct.Struct("<I")
_GROUP = re.compile(r"[A-Za-z0-9_\-][A-Za-z0-9 _.\-]{0,249}\Z")
# The deepest group is runs/<id>/touch/gaps.
_DEPTH = 4
_MAX_NODES = 10_000
# Counters and row counts beyond this are no recording's: sums of them stay in 64 bits.
_MAX_COUNT = 2**48


@dataclass(frozen=True)
class Record:
    """One commit of a recording.

    ``heads``: session and open runs, repeated as other records may be damaged; ``rows``: path → rows in earlier
    records; ``runs``: runs begun.
    """

    nodes: tuple[Node, ...]
    heads: tuple[Node, ...] = ()
    rows: Mapping[str, int] = field(default_factory=dict)
    runs: int = 0


def encode(record: Record) -> bytes:
    body: list[bytes] = []
    head = {
        "nodes": [_head(node, body) for node in record.nodes],
        "heads": [_head(node, body) for node in record.heads],
        "rows": dict(record.rows),
        "runs": record.runs,
    }
    text = json.dumps(head, separators=(",", ":"), default=_plain).encode()
    return b"".join([_LENGTH.pack(len(text)), text, *body])


def decode(data: bytes) -> Record:
    """The record; its columns are views of ``data``. Raises DataError."""
    try:
        (length,) = _LENGTH.unpack_from(data)
        at = _LENGTH.size + length
        head = json.loads(data[_LENGTH.size : at].decode("utf-8"))
        if len(head["nodes"]) + len(head["heads"]) > _MAX_NODES:
            raise DataError("the record holds too many groups")
        nodes, at = _nodes(head["nodes"], data, at)
        heads, at = _nodes(head["heads"], data, at)
        rows = {_path(key): _count(value) for key, value in head["rows"].items()}
        runs = _count(head["runs"])
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError, struct.error) as error:
        raise DataError("the record is not what a recording writes") from error
    if at != len(data):
        raise DataError("the record has bytes that belong to no column")
    return Record(nodes, heads, rows, runs)


def _plain(value: Any) -> Any:
    return value.item()


def _head(node: Node, body: list[bytes]) -> list[Any]:
    columns: list[list[Any]] = []
    if node.table is not None:
        kinds = {column.name: column.dtype for column in node.table.every()}
        for name, values in node.rows.items():
            if len(values):
                columns.append([name, len(values)])
                body.append(np.ascontiguousarray(values, kinds[name]).tobytes())
    table = "" if node.table is None else _NAMES[id(node.table)]
    return [node.path, dict(node.attrs), dict(node.counts), dict(node.texts), table, columns]


def _nodes(heads: list[Any], data: bytes, at: int) -> tuple[tuple[Node, ...], int]:
    nodes: list[Node] = []
    for path, attrs, counts, texts, name, columns in heads:
        table = TABLES[name] if name else None
        kinds = {} if table is None else {column.name: column.dtype for column in table.every()}
        rows: dict[str, Any] = {}
        for column, count in columns:
            if column in rows:
                raise DataError("the record holds a column twice")
            rows[column] = np.frombuffer(data, kinds[column], _count(count), at)
            at += rows[column].nbytes
        if len({len(values) for values in rows.values()}) > 1:
            raise DataError("the record holds columns of different lengths")
        if rows and table is not None:
            _check_columns(table, rows)
        nodes.append(
            Node(
                _path(path),
                {_name(key): _value(value) for key, value in attrs.items()},
                {_name(key): _count(value) for key, value in counts.items()},
                {_name(key): _text(value) for key, value in texts.items()},
                table,
                rows,
            )
        )
    return tuple(nodes), at


def _check_columns(table: Table, rows: Mapping[str, Any]) -> None:
    needed = {column.name for column in table.columns if not column.optional}
    if table.scale.kind != "i":
        needed.add(table.scale.name)
    if not needed <= set(rows):
        raise DataError("the record lacks a column")


def _path(path: Any) -> str:
    parts = _text(path).split("/") if path else []
    if len(parts) > _DEPTH or (parts and parts[0] not in schema.RAW_GROUPS) or not all(map(_GROUP.match, parts)):
        raise DataError("the record names a group that no session has")
    return "/".join(parts)


def _name(key: str) -> str:
    if not 0 < len(key) <= 200 or "\0" in key:
        raise DataError("the record names an attribute that no session has")
    return key


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise DataError("the record holds something else for a text")
    return value


def _number(value: Any) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not -(2**63) <= value < 2**63:
        raise DataError("the record holds something else for a whole number")
    return value


def _count(value: Any) -> int:
    if not 0 <= _number(value) < _MAX_COUNT:
        raise DataError("the record holds a count that cannot be")
    return int(value)


def _value(value: Any) -> Value:
    return value if isinstance(value, str | float) else _number(value)
