"""netCDF-4, structured as a session file."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from draglag.errors import DataError
from draglag.messages import message
from draglag.recording import Session
from draglag.store.analysis import StoredAnalysis, result_nodes
from draglag.store.build import reason, zero_utc
from draglag.store.schema import Column, Node
from draglag.store.session_nodes import distinct, session_nodes
from draglag.store.stored import blocks
from draglag.system.packages import advice
from draglag.system.temporary import new_file


def write_netcdf(session: Session, path: Path | str, results: Sequence[StoredAnalysis] = ()) -> Path:
    """The netCDF-4 file. Raises DataError, also without h5netcdf."""
    path = Path(path)
    try:
        h5netcdf: Any = importlib.import_module("h5netcdf")
    except ModuleNotFoundError as missing:
        raise DataError(*advice(missing.name or "")) from missing
    start = zero_utc(session.started_utc, session.started_s)
    try:
        with new_file(path) as growing, h5netcdf.File(growing, "w") as file:
            for node in distinct(chain(session_nodes(session), *map(result_nodes, results))):
                _put(file, node, start)
    except OSError as error:
        raise DataError(
            message("{path}: cannot be written ({why})", path=path, why=reason(error)),
            "Check the folder and free space",
        ) from error
    return path


def _put(file: Any, node: Node, start: str) -> None:
    group = file
    for name in filter(None, node.path.split("/")):
        group = group.groups[name] if name in group.groups else group.create_group(name)
    for key, value in {**node.attrs, **node.counts, **node.texts}.items():
        group.attrs[key] = value
    if node.table is None:
        return
    length = max((len(values) for values in node.rows.values()), default=0)
    dimension = node.table.scale.name
    group.dimensions = {dimension: length}
    for column in node.table.every():
        values: Any = node.rows.get(column.name, ())
        if column is node.table.scale and column.kind == "i":
            values = np.arange(length)
        elif not len(values) and column.optional:
            continue
        variable = _variable(group, column, dimension, values)
        variable.attrs["units"] = column.units
        variable.attrs["long_name"] = column.meaning
        if column.name == "time" and start:
            variable.attrs["start"] = start


def _variable(group: Any, column: Column, dimension: str, values: Any) -> Any:
    text = column.kind.startswith("S")
    kind = h5py.string_dtype() if text else column.dtype
    variable = group.create_variable(column.name, (dimension,), dtype=kind)
    if text and len(values):
        variable[...] = np.array([value.decode() for value in values], dtype=object)
    elif len(values):
        for rows in blocks(len(values)):
            variable[rows] = np.asarray(values[rows], column.dtype)
    return variable
