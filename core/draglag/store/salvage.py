"""Saving what a killed recording left behind, and saying what is wrong with a file."""

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
from draglag.recording import LogEntry, Run, Session
from draglag.store import schema
from draglag.store.read import header_v1, run_v1
from draglag.store.safely import BROKEN, check_schema, dataset_problem, open_hdf5, short, tree_problems
from draglag.store.write import PARTIAL, write_session

_TABLES = {
    "touch": schema.TOUCH,
    "laser": schema.LASER,
    "display": schema.DISPLAY,
    "gaps": schema.GAPS,
    "axes": schema.AXES,
    "log": schema.LOG,
    "notes": schema.LOG,
    "taps": schema.TAPS,
}


@dataclass(frozen=True)
class Salvaged:
    """What could be saved: the session, the file it is in now, and what was lost."""

    session: Session
    path: Path
    losses: tuple[str, ...]


def partial_files(folder: Path | str) -> list[Path]:
    """Recordings that ended without being closed and were not saved since: what the next start offers to salvage."""
    found = sorted(Path(folder).glob(f"*{PARTIAL}"))
    return [path for path in found if not final_name(path).exists()]


def final_name(unfinished: Path | str) -> Path:
    """``session.h5.partial`` → ``session.h5``; another name gets ``-salvaged``."""
    path = Path(unfinished)
    if path.name.endswith(PARTIAL):
        return path.with_name(path.name.removesuffix(PARTIAL))
    return path.with_name(f"{path.stem}-salvaged{path.suffix}")


def salvage(unfinished: Path | str, out: Path | str | None = None) -> Salvaged:
    """Copy everything readable of an unfinished or damaged file into a whole one; the old file stays as it is.

    Runs that were being recorded become "aborted". Raises DataError when nothing can be saved, or ``out`` exists.
    """
    unfinished = Path(unfinished)
    target = Path(out) if out is not None else final_name(unfinished)
    if target.exists():
        raise DataError(f"{target}: exists already and is not overwritten", "Give another name with --out")
    session, losses = recover(unfinished)
    note = f"saved from {unfinished.name}" + "".join(f"; {loss}" for loss in losses)
    last_s = max((run.start_s + run.duration_s for run in session.runs), default=0.0)
    session = replace(session, notes=(*session.notes, LogEntry(last_s, "warning", "salvage", note)))
    return Salvaged(session, write_session(session, target), tuple(losses))


def recover(path: Path) -> tuple[Session, list[str]]:
    """Everything readable of a damaged file, and what was lost. Raises DataError when that is nothing."""
    losses: list[str] = []
    with open_hdf5(path) as file, h5py.File("salvage", "w", driver="core", backing_store=False) as copy:
        check_schema(file, path)
        for name, problem in tree_problems(file) if _walkable(file) else []:
            losses.append(f"/{name} {problem}")
        _attempt(losses, "the root", lambda: _copy_attrs(file, copy))
        for name in schema.RAW_GROUPS:
            _attempt(losses, f"/{name}", partial(_copy, file, name, copy, losses))
        _attempt(losses, "/protocol_toml", lambda: _copy(file, "protocol_toml", copy, losses))
        runs: list[Run] = []
        for name in list(copy["runs"]) if "runs" in copy else []:
            _attempt(losses, f"run {name}", partial(_add_run, runs, copy["runs"], name))
        try:
            return header_v1(copy, tuple(runs)), losses
        except (*BROKEN, DataError) as error:
            raise DataError(f"{path}: nothing could be saved ({short(error)})", "Record again") from error


def _add_run(runs: list[Run], group: Any, name: str) -> None:
    runs.append(run_v1(group[name]))


def _walkable(file: Any) -> bool:
    try:
        list(tree_problems(file))
    except BROKEN:
        return False
    return True


def _attempt(losses: list[str], what: str, action: Callable[[], object]) -> None:
    try:
        action()
    except (*BROKEN, DataError) as error:
        losses.append(f"{what} is lost ({short(error)})")


def _copy_attrs(source: Any, target: Any) -> None:
    for key in source.attrs:
        if key not in ("DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME"):
            target.attrs[key] = source.attrs[key]


def _copy(parent: Any, name: str, target: Any, losses: list[str], depth: int = 0) -> None:
    """Copy one item and what is below it, leaving out what cannot be read."""
    if name not in parent or depth > 6 or not isinstance(parent.get(name, getlink=True), h5py.HardLink):
        return
    item = parent[name]
    if isinstance(item, h5py.Dataset):
        if not dataset_problem(item):
            target.create_dataset(name, data=item[()])
        return
    group = target.require_group(name)
    _copy_attrs(item, group)
    table = schema.CLOCK if "stream" in item.attrs else _TABLES.get(name)
    columns = _copy_table(item, table, group, losses) if table is not None else set()
    for key in item:
        if key not in columns:
            where = f"{item.name}/{key}"
            _attempt(losses, where, partial(_copy, item, key, group, losses, depth + 1))


def _copy_table(source: Any, table: schema.Table, target: Any, losses: list[str]) -> set[str]:
    """Copy the rows that every column has; rows HDF5 made room for but never wrote are left out."""
    columns: dict[str, NDArray[Any]] = {}
    for column in table.every():
        if column.name in source:
            columns[column.name] = _readable_rows(source[column.name])
    length = min((len(values) for values in columns.values()), default=0)
    times = next((columns[c.name] for c in table.every() if c.kind == "f" and c.name in columns), None)
    if times is not None:
        # A torn write leaves fill values at the end, and only there.
        written = np.flatnonzero(~np.isnan(times[:length]))
        length = int(written[-1]) + 1 if len(written) else 0
    longest = max((len(values) for values in columns.values()), default=0)
    if longest > length:
        losses.append(f"{source.name}: {longest - length} unfinished rows are lost")
    for column in table.every():
        if column.name in columns or not column.optional:
            values = columns.get(column.name, np.empty(0, column.dtype))
            target.create_dataset(column.name, data=values[:length])
    return {column.name for column in table.every()}


def _readable_rows(dataset: Any) -> NDArray[Any]:
    """The rows up to the first that cannot be read."""
    if dataset_problem(dataset) or dataset.ndim != 1:
        return np.empty(0, dataset.dtype)
    try:
        whole: NDArray[Any] = dataset[()]
        return whole
    except (OSError, RuntimeError):
        step = (dataset.chunks or (1024,))[0]
        parts: list[NDArray[Any]] = []
        for start in range(0, dataset.shape[0], step):
            try:
                parts.append(dataset[start : start + step])
            except (OSError, RuntimeError):
                break
        return np.concatenate(parts) if parts else np.empty(0, dataset.dtype)
