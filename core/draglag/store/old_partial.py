"""What can be read of damaged HDF5: session files, and ``.partial`` files of early recordings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from draglag.errors import DataError
from draglag.messages import message
from draglag.recording import Run, Session
from draglag.store import schema
from draglag.store.checksum import raw_checksum
from draglag.store.codec import TABLES
from draglag.store.read import run_of, session_of
from draglag.store.safely import (
    BROKEN,
    TOO_LARGE,
    check_schema,
    dataset_problem,
    open_hdf5,
    short,
    text_attr,
    tree_problems,
)
from draglag.store.sense import first_problem

_TABLES = {**TABLES, "notes": schema.LOG}
# Groups below a run that are made empty where they are lost, so that the rest of the run is kept.
_STREAMS = ("touch", "laser")


@dataclass(frozen=True)
class _Rows:
    values: NDArray[Any]
    readable: NDArray[np.bool_]


def recover(path: Path) -> tuple[Session, list[str]]:
    """Everything readable, and the losses. Raises DataError if nothing."""
    losses: list[str] = []
    with open_hdf5(path) as file, h5py.File("salvage", "w", driver="core", backing_store=False) as copy:
        check_schema(file, path)
        problems = _problems(file)
        losses += [message("/{name} {problem}", name=name, problem=problem) for name, problem in problems]
        if any(problem == TOO_LARGE for _, problem in problems):
            raise DataError(
                message("{path}: unpacked it is far larger than a recording can be", path=path),
                "Use the file as recorded",
            )
        if not problems:  # a checksum looks at everything, also where it should not
            _attempt(losses, message("the checksum"), lambda: _compare_checksum(file, losses))
        left_out = frozenset(name for name, _ in problems)
        _attempt(losses, message("the root"), lambda: _copy_attrs(file, copy))
        for name in schema.RAW_GROUPS:
            _attempt(losses, f"/{name}", partial(_copy, file, name, copy, losses, left_out))
        _attempt(losses, "/protocol_toml", lambda: _copy(file, "protocol_toml", copy, losses, left_out))
        runs: list[Run] = []
        for name in list(copy["runs"]) if "runs" in copy else []:
            _attempt(losses, message("run {name}", name=name), partial(_add_run, runs, copy["runs"], name, losses))
        session = _with_header(copy, tuple(runs), losses, path)
        return session, losses


def _with_header(copy: Any, runs: tuple[Run, ...], losses: list[str], path: Path) -> Session:
    for optional in ("", "taps", "notes", "clocks", "calibration", "beam", "devices", "details", "protocol_toml"):
        if optional and optional in copy:
            losses.append(message("/{optional} is lost", optional=optional))
            del copy[optional]
        try:
            return session_of(copy, runs)
        except (*BROKEN, DataError) as error:
            why = error
    raise DataError(
        message(
            "{path}: {n} runs can be read, and what the session is cannot ({why})",
            path=path,
            n=len(runs),
            why=short(why),
        ),
        "Keep the file; try another copy of it",
    ) from why


def _problems(file: Any) -> list[tuple[str, str]]:
    found: list[tuple[str, str]] = []
    try:
        found.extend(tree_problems(file))
    except BROKEN:
        found.append(("", message("cannot be looked through as a whole")))
    return found


def _compare_checksum(file: Any, losses: list[str]) -> None:
    try:
        known = text_attr(file, "raw_sha256", "")
        same = not known or known == raw_checksum(file)
    except BROKEN:
        return  # what cannot be read is named item by item
    if not same:
        losses.append(message("some raw data were changed after recording: the checksum does not match"))


def _add_run(runs: list[Run], parent: Any, name: str, losses: list[str]) -> None:
    group = parent[name]
    for stream in _STREAMS:
        if not isinstance(group.get(stream), h5py.Group):
            losses.append(message("run {name}: {stream} is lost", name=name, stream=stream))
            _make_empty(group, stream)
    _guess_attrs(group, name, losses)
    for optional in ("", "log", "sync", "display", "target", "touch/axes", "touch/gaps", "laser/gaps"):
        if optional and optional in group:
            losses.append(message("run {name}: {optional} is lost", name=name, optional=optional))
            del group[optional]
        try:
            run = run_of(group)
            break
        except (*BROKEN, DataError) as error:
            why = error
    else:
        raise DataError(short(why))
    runs.append(_in_order(run, losses))


def _make_empty(group: Any, stream: str) -> None:
    if stream in group:
        del group[stream]
    made = group.create_group(stream)
    for column in TABLES[stream].every():
        if not column.optional:
            made.create_dataset(column.name, data=np.empty(0, column.dtype))


def _guess_attrs(group: Any, name: str, losses: list[str]) -> None:
    times = np.concatenate([group[stream]["time"][()] for stream in _STREAMS if "time" in group[stream]])
    times = times[np.isfinite(times)]
    start_s, end_s = (float(times.min()), float(times.max())) if len(times) else (0.0, 0.0)
    for key, value in (("protocol", "free"), ("start_s", start_s), ("duration_s", end_s - start_s)):
        if key not in group.attrs:
            losses.append(message("run {name}: {key} is lost, it was estimated from the samples", name=name, key=key))
            group.attrs[key] = value


def _in_order(run: Run, losses: list[str]) -> Run:
    for stream in _STREAMS:
        trace: Any = getattr(run, stream)
        if not first_problem(stream, trace.t_s, run):
            continue
        near = np.isfinite(trace.t_s)
        near[near] = [not first_problem(stream, trace.t_s[k : k + 1], run) for k in np.flatnonzero(near)]
        latest = np.maximum.accumulate(np.where(near, trace.t_s, -np.inf))
        kept = near & (trace.t_s >= latest)
        losses.append(
            message(
                "run {run}: {n} {stream} samples have times that cannot be",
                run=run.id,
                n=int((~kept).sum()),
                stream=stream,
            )
        )
        columns = {
            key: values[kept]
            for key, values in vars(trace).items()
            if isinstance(values, np.ndarray) and values.ndim == 1 and len(values) == len(kept)
        }
        run = replace(run, **{stream: replace(trace, **columns)})
    return run


def _attempt(losses: list[str], what: str, action: Callable[[], object]) -> None:
    try:
        action()
    except (*BROKEN, DataError) as error:
        losses.append(message("{what} is lost ({why})", what=what, why=short(error)))


def _copy_attrs(source: Any, target: Any, losses: list[str] | None = None) -> None:
    for key in source.attrs:
        if key in ("DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME"):
            continue
        try:
            target.attrs[key] = source.attrs[key]
        except BROKEN as error:
            if losses is None:
                raise
            losses.append(message("{source}: {key} is lost ({why})", source=source.name, key=key, why=short(error)))


def _copy(parent: Any, name: str, target: Any, losses: list[str], left_out: frozenset[str], depth: int = 0) -> None:
    where = f"{parent.name}/{name}".strip("/")
    if where in left_out or depth > 6 or not isinstance(parent.get(name, getlink=True), h5py.HardLink):
        return
    item = parent[name]
    if isinstance(item, h5py.Dataset):
        if not dataset_problem(item.id):
            target.create_dataset(name, data=item[()])
        return
    group = target.require_group(name)
    _copy_attrs(item, group, losses)
    table = schema.CLOCK if "stream" in item.attrs else _TABLES.get(name)
    columns = _copy_table(item, table, group, losses, left_out) if table is not None else set()
    for key in item:
        if key not in columns:
            where = f"{item.name}/{key}"
            _attempt(losses, where, partial(_copy, item, key, group, losses, left_out, depth + 1))


def _copy_table(source: Any, table: schema.Table, target: Any, losses: list[str], left_out: frozenset[str]) -> set[str]:
    present = [c for c in table.every() if f"{source.name}/{c.name}".strip("/") not in left_out]
    columns = {c.name: _readable_rows(source, c) for c in present if c.name in source}
    scale = columns.get(table.scale.name)
    counted = len(scale.values) if scale is not None else 0
    longest = max((len(column.values) for name, column in columns.items() if name != table.scale.name), default=0)
    # Of a row whose number alone is left, nothing is.
    length = min(counted, longest) if table.scale.kind == "i" else counted
    lost_rows = max(counted, longest) - length
    if lost_rows:
        losses.append(message("{source}: {n} unfinished rows are lost", source=source.name, n=lost_rows))
    kept = _rows_with_times(scale, table, length)
    if not kept.all():
        losses.append(message("{source}: {n} rows are lost with their times", source=source.name, n=int((~kept).sum())))
    for column in table.every():
        rows = columns.get(column.name)
        if rows is None and column.optional:
            continue
        values, lost = _filled(rows, column, length)
        if lost and column is not table.scale:
            losses.append(
                message(
                    "{source}/{column}: {lost} of {length} values are lost",
                    source=source.name,
                    column=column.name,
                    lost=lost,
                    length=length,
                )
            )
        target.create_dataset(column.name, data=values[kept])
    return {column.name for column in table.every()}


def _filled(rows: _Rows | None, column: schema.Column, length: int) -> tuple[np.ndarray, int]:
    """(length,) values of a column, and how many of them could not be read."""
    values = np.full(length, column.fill, column.dtype)
    if rows is None:
        return values, length
    values[: len(rows.values)] = rows.values[:length]
    return values, length - int(rows.readable[:length].sum())


def _rows_with_times(scale: _Rows | None, table: schema.Table, length: int) -> np.ndarray:
    """Rows with a readable scale; a non-finite time is room never filled."""
    if scale is None or table.scale.kind == "i":
        return np.ones(length, bool)
    return scale.readable & np.isfinite(scale.values) if table.scale.kind == "f" else scale.readable.copy()


def _readable_rows(source: Any, column: schema.Column) -> _Rows:
    nothing = _Rows(np.empty(0, column.dtype), np.empty(0, bool))
    try:
        dataset = source[column.name]
        if not isinstance(dataset, h5py.Dataset) or dataset_problem(dataset.id) or dataset.ndim != 1:
            return nothing
        if (dataset.dtype.kind == "S") != column.kind.startswith("S"):
            return nothing
        length = int(dataset.shape[0])
    except BROKEN:
        return nothing
    values = np.full(length, column.fill, column.dtype)
    readable = np.zeros(length, bool)
    step = max(length, 1)
    try:
        values[:] = dataset[()]
        return _Rows(values, np.ones(length, bool))
    except BROKEN:
        step = (dataset.chunks or (1024,))[0]
    for start in range(0, length, step):
        try:
            values[start : start + step] = dataset[start : start + step]
            readable[start : start + step] = True
        except BROKEN:
            continue
    return _Rows(values, readable)
