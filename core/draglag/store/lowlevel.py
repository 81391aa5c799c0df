"""HDF5 operations shared by all writers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from draglag.store.schema import (
    TEXTS,
    Column,
    Node,
    Table,
    Value,
    as_text,
)

# How netCDF and xarray learn that the bytes of a text are UTF-8. The HDF5 type of texts is its ASCII one, which says
# nothing of bytes above 127: Octave, and older readers, cannot load its UTF-8 type at all.
_UTF8 = {"_Encoding": "utf-8"}


def put_attrs(target: Any, attrs: Mapping[str, Value]) -> None:
    """Set attributes; text of fixed length, as some readers cannot load HDF5's variable one."""
    for key, value in attrs.items():
        if isinstance(value, str):
            data = as_text(value).encode()
            kind = h5py.string_dtype("utf-8", max(len(data), 1))
            target.attrs.create(key, np.array(data, kind), dtype=kind)
        elif isinstance(value, int | np.integer):
            target.attrs[key] = np.int64(value)
        else:
            target.attrs[key] = np.float64(value)


def add_counts(group: Any, counts: Mapping[str, int]) -> None:
    """Add to counters."""
    for key, value in counts.items():
        if key in group.attrs:
            if value:
                group.attrs.modify(key, np.int64(int(group.attrs[key]) + int(value)))
        else:
            group.attrs[key] = np.int64(value)


def _put_text(group: Any, name: str, text: str, meaning: str) -> None:
    """A scalar dataset, as attributes end at 64 KiB."""
    data = as_text(text).encode()
    dataset = group.create_dataset(name, data=np.array(data, f"S{max(len(data), 1)}"))
    put_attrs(dataset, {"units": "1", "long_name": meaning, **_UTF8})


def make_column(group: Any, column: Column, chunk: int, length: int = 0) -> Any:
    """A growing column; its first ``length`` rows hold the fill value."""
    dataset = group.create_dataset(
        column.name, shape=(length,), maxshape=(None,), chunks=(chunk,), dtype=column.dtype, fillvalue=column.fill
    )
    text = _UTF8 if column.kind.startswith("S") else {}
    put_attrs(dataset, {"units": column.units, "long_name": column.meaning, **text})
    return dataset


def make_table(group: Any, table: Table, present: Mapping[str, Any], start: str) -> None:
    """Make columns that are required or have rows. ``start``: ISO 8601 of the zero of ``time``."""
    scale = make_column(group, table.scale, table.chunk)
    scale.make_scale(table.scale.name)
    if table.scale.name == "time" and start:
        put_attrs(scale, {"start": start})
    for column in table.columns:
        if not column.optional or len(present.get(column.name, ())):
            make_column(group, column, table.chunk).dims[0].attach_scale(scale)


def append_rows(group: Any, table: Table, rows: Mapping[str, NDArray[Any]]) -> None:
    """Append rows to every column, the scale last: rows it counts are complete.

    Low-level h5py, as five appends a second must not delay the target's drawing.
    """
    total = max((len(values) for values in rows.values()), default=0)
    if not total:
        return
    scale = _column(group, table.scale.name)
    before = scale.shape[0]
    for column in table.columns:
        values = rows.get(column.name, np.empty(0))
        if column.name.encode() not in group.id:
            if not len(values):
                continue
            make_column(group, column, table.chunk, before).dims[0].attach_scale(group[table.scale.name])
        if len(values) not in (0, total):
            raise ValueError(f"{group.name}/{column.name}: {len(values)} rows, others {total}")
        _extend(_column(group, column.name), before, values if len(values) else np.full(total, column.fill))
    counted = np.arange(before, before + total)
    _extend(scale, before, counted if table.scale.kind == "i" else rows[table.scale.name])


def _column(group: Any, name: str) -> Any:
    return h5py.h5d.open(group.id, name.encode())


def _extend(column: Any, before: int, values: NDArray[Any]) -> None:
    count = len(values)
    column.set_extent((before + count,))
    stored = np.ascontiguousarray(values, column.dtype)
    space = column.get_space()
    space.select_hyperslab((before,), (count,))
    column.write(h5py.h5s.create_simple((count,)), space, stored)


def put_node(file: Any, node: Node, start: str = "") -> None:
    """Write or extend one group."""
    group = file.require_group(node.path) if node.path else file
    put_attrs(group, node.attrs)
    add_counts(group, node.counts)
    for name, text in node.texts.items():
        _put_text(group, name, text, TEXTS[name])
    if node.table is not None:
        if node.table.scale.name not in group:
            make_table(group, node.table, node.rows, start)
        append_rows(group, node.table, node.rows)
