"""Results next to the raw data: /analysis/<n>."""

from __future__ import annotations

import json
import math
import os
import shutil
import stat
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import draglag
from draglag.errors import DataError
from draglag.messages import message
from draglag.store.build import safe_hdf5
from draglag.store.checksum import raw_checksum
from draglag.store.journal import is_journal
from draglag.store.lowlevel import put_node
from draglag.store.nexus import CURVE, mark
from draglag.store.safely import named_errors, open_hdf5, open_session, short, text_attr
from draglag.store.schema import (
    Column,
    Node,
    Table,
    Value,
    encode,
)
from draglag.store.state import FileState, file_identity
from draglag.system.temporary import temporary_for

_SOFTWARE = f"draglag {draglag.__version__}"
_UNITS = (("_mm_s", "mm/s"), ("_s_per_mm", "s/mm"), ("_mm2", "mm2"), ("_mm", "mm"), ("_ms", "ms"), ("_hz", "Hz"))
# Room for a result in the file: groups and attributes (bytes), and its text again as columns, at four bytes a letter.
_BASE = 1 << 20
_COPIES = 4
_MORE_UNITS = (("_percent", "percent"), ("_s", "s"))


@dataclass(frozen=True)
class StoredAnalysis:
    """A stored result; ``up_to_date``: made from the present raw data."""

    number: int
    result: dict[str, Any]
    options: dict[str, Any]
    software: str
    created_utc: str
    input_sha256: str
    up_to_date: bool


def add_analysis(
    path: Path | str,
    result: Mapping[str, Any],
    options: Mapping[str, Any],
    created_utc: str = "",
    analysed: FileState | None = None,
) -> int:
    """The number (1, 2 …) of the stored result; an equal one already stored keeps its number.

    analysed: state of the file when the session was read. Raises DataError, also where the raw data are others now.
    """
    path = Path(path).resolve()
    with _checked(path, analysed) as (file, checksum):
        number = 1 + max((int(name) for name in file.get("analysis", ()) if name.isdecimal()), default=0)
        for name in filter(str.isdecimal, file.get("analysis", ())):
            if _is_same(file[f"analysis/{name}"], result, options, checksum):
                return int(name)
    if not path.stat().st_mode & stat.S_IWRITE:  # a file of that kind can be replaced all the same
        raise DataError(message("{path}: is write-protected", path=path), "Copy it, or give it the right to be written")
    about = _SOFTWARE, created_utc, checksum, True
    stored = StoredAnalysis(number, dict(result), dict(options), *about)
    room = _BASE + _COPIES * (len(to_json(options)) + len(to_json(result)))
    try:
        with temporary_for(path) as copy:
            shutil.copyfile(path, copy)
            shutil.copymode(path, copy)
            descriptor = os.open(copy, os.O_RDWR)
            try:
                with safe_hdf5(descriptor, "r+", room, path) as (file, _):
                    for node in result_nodes(stored):
                        put_node(file, node)
                    mark(file)
            finally:
                os.close(descriptor)
            os.replace(copy, path)
    except OSError as error:
        raise DataError(
            message("{path}: cannot be written ({why})", path=path, why=short(error)), "Check rights and free space"
        ) from error
    return number


@contextmanager
def _checked(path: Path, analysed: FileState | None) -> Iterator[tuple[Any, str]]:
    """Yields the file and the checksum of its raw data; an unchanged file is not checked again."""
    if analysed is not None and analysed.identity is not None and analysed.identity == file_identity(path):
        with named_errors(path), open_hdf5(path) as file:
            yield file, analysed.raw_sha256
        return
    with open_session(path) as file:
        checksum = raw_checksum(file)
        if analysed is not None and checksum != analysed.raw_sha256:
            raise DataError(
                message("{path}: has other raw data now than were analysed", path=path), "Open and analyse it again"
            )
        yield file, checksum


def read_analyses(path: Path | str) -> list[StoredAnalysis]:
    """Stored results, oldest first; a journal has none. Raises DataError."""
    if is_journal(Path(path)):
        return []
    with open_session(path) as file:
        groups = file.get("analysis", {})
        names = sorted(filter(str.isdecimal, groups), key=int)
        checksum = raw_checksum(file) if names else ""
        return [_stored(int(name), groups[name], checksum) for name in names]


def _is_same(group: Any, result: Mapping[str, Any], options: Mapping[str, Any], checksum: str) -> bool:
    if (text_attr(group, "input_sha256", ""), text_attr(group, "software", "")) != (checksum, _SOFTWARE):
        return False
    texts = (("options_json", options), ("result_json", result))
    return all(bytes(group[name][()]).decode() == to_json(value) for name, value in texts)


def result_nodes(stored: StoredAnalysis) -> Iterator[Node]:
    """Groups of a result: JSON, and a table per list of records."""
    path = f"analysis/{stored.number}"
    about: dict[str, Value] = {"software": stored.software, "created_utc": stored.created_utc}
    about["input_sha256"] = stored.input_sha256
    yield Node(path, about, texts={"options_json": to_json(stored.options), "result_json": to_json(stored.result)})
    for key, rows in stored.result.items():
        if isinstance(rows, Sequence) and rows and all(isinstance(row, Mapping) for row in rows):
            yield _table_node(f"{path}/{key}", key, rows)
    if drawn := _curve(stored.result):
        yield _table_node(f"{path}/{CURVE}", CURVE, drawn)


def to_json(value: Any) -> str:
    """JSON text; NaN and infinity become null."""
    return json.dumps(_plain(value), ensure_ascii=False, allow_nan=False)


def _stored(number: int, group: Any, checksum: str) -> StoredAnalysis:
    stored = text_attr(group, "input_sha256", "")
    return StoredAnalysis(
        number,
        json.loads(group["result_json"][()]),
        json.loads(group["options_json"][()]),
        text_attr(group, "software", ""),
        text_attr(group, "created_utc", ""),
        stored,
        stored == checksum,
    )


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _table_node(path: str, name: str, records: Sequence[Mapping[str, Any]]) -> Node:
    flat = [flat_record(record) for record in records]
    columns: list[Column] = []
    rows: dict[str, Any] = {}
    for key in dict.fromkeys(key for record in flat for key in record):
        values = [record.get(key) for record in flat]
        if all(value is None or isinstance(value, int | float) for value in values):
            column = Column(key, "f", _unit(key), key.replace("_", " "))
            rows[key] = np.array([math.nan if value is None else float(value) for value in values])
        else:
            texts = ["" if value is None else str(value) for value in values]
            width = max(1, *(len(text.encode()) for text in texts))
            column = Column(key, f"S{width}", "1", key.replace("_", " "))
            rows[key] = encode(column, texts)
        columns.append(column)
    table = Table(Column(f"{name}_row", "i", "1", "number of the row"), tuple(columns), max(8, len(flat)))
    return Node(path, table=table, rows=rows)


def _curve(result: Mapping[str, Any]) -> list[dict[str, Any]]:
    drawn = []
    for row in result.get("runs", ()):
        known = _plain(row)
        speed, latency, interval = (known.get(key) for key in ("speed_mm_s", "latency_ms", "latency_ci95_ms"))
        if speed is not None and latency is not None:
            half = (interval[1] - interval[0]) / 2 if interval and None not in interval else None
            drawn.append({"run": known["id"], "speed_mm_s": speed, "latency_ms": latency, "latency_ms_errors": half})
    return sorted(drawn, key=lambda row: float(row["speed_mm_s"]))


def flat_record(record: Mapping[str, Any]) -> dict[str, Any]:
    """Name → cell; an interval becomes two, a list one text; nested fields are omitted."""
    flat: dict[str, Any] = {}
    for key, value in _plain(record).items():
        if isinstance(value, list) and "ci95" in key and len(value) == 2:
            flat[key.replace("ci95", "ci95_low")], flat[key.replace("ci95", "ci95_high")] = value
        elif isinstance(value, list):
            flat[key] = " ".join(str(item) for item in value)
        elif not isinstance(value, dict):
            flat[key] = value
    return flat


def _unit(key: str) -> str:
    name = key.replace("_ci95_low", "").replace("_ci95_high", "").removesuffix("_errors")
    return next((unit for end, unit in (*_UNITS, *_MORE_UNITS) if name.endswith(end)), "1")
