"""Damaged or hostile session files: checked before reading, no link followed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from h5py import h5a, h5d, h5g, h5o, h5s, h5z
from numpy.typing import NDArray

from draglag.errors import DataError, DraglagError, message_of
from draglag.messages import Message, message, phrase
from draglag.store.frames import MAGIC
from draglag.store.items import attribute, attribute_sizes, links
from draglag.store.schema import (
    SCHEMA,
    VERSION,
    Column,
    Table,
    Value,
)

MAX_BYTES = 2**31
MAX_ITEMS = 200_000
MAX_DEPTH = 8
_MAX_ATTRIBUTE_BYTES = 2**20
_MAX_ATTRIBUTES = 1000
_DEFLATE_LIMIT = 1100  # deflate cannot shrink data further than about 1030 to 1
# All columns together, unpacked, for each byte of the file: recorded numbers do not pack below a tenth of themselves,
# columns that hold one value throughout may add as much again.
_WHOLE_LIMIT = 100
_SLACK_BYTES = 2**24
_OF_SCALES = {b"DIMENSION_LIST", b"REFERENCE_LIST"}  # read by HDF5 alone
_FILTERS = {h5z.FILTER_DEFLATE, h5z.FILTER_SHUFFLE, h5z.FILTER_FLETCHER32}  # built in; others would load a plug-in
# Of every open column: they are read from end to end, so what has been read is not needed again. HDF5 2.0 takes 8 MiB.
_CHUNK_CACHE_BYTES = 2**18
TOO_LARGE = message("makes the file too large when unpacked")
BROKEN = (
    OSError,
    RuntimeError,
    LookupError,
    ValueError,
    TypeError,
    AttributeError,
    OverflowError,
    MemoryError,
)


@contextmanager
def open_session(path: Path | str) -> Iterator[Any]:
    """Yields the file, read only, after a check of every item.

    Raises DataError: no such file, not HDF5, truncated, another format, a newer version, links that lead elsewhere,
    impossible types or sizes; also for HDF5 errors in the block.
    """
    path = Path(path)
    with named_errors(path), open_hdf5(path) as file:
        check_schema(file, path)
        check_tree(file, path)
        yield file


@contextmanager
def named_errors(path: Path) -> Iterator[None]:
    """Errors of the block become DataErrors with file name and remedy."""
    try:
        yield
    except DraglagError as error:
        raise _named(error, path) from error
    except BROKEN as error:
        raise DataError(
            message("{path}: is damaged ({why})", path=path, why=short(error)),
            message("Try `draglag verify {path}` to see what can be saved", path=path),
        ) from error


def _named(error: DraglagError, path: Path) -> DraglagError:
    if error.problem.startswith(str(path)) and error.remedy:
        return error
    named = error.problem.startswith(str(path))
    problem = error.problem if named else message("{path}: {problem}", path=path, problem=error.problem)
    return DataError(
        problem, error.remedy or message("Try `draglag verify {path}` to see what can be saved", path=path)
    )


@contextmanager
def open_hdf5(path: Path) -> Iterator[Any]:
    """Yields an HDF5 file, read only. Raises DataError."""
    if not path.exists():
        raise DataError(message("{path}: there is no such file", path=path), "Check the name")
    if is_unfinished(path):
        raise DataError(
            message("{path}: is a recording that was not closed", path=path),
            message("Save it first with `draglag verify {path}`", path=path),
        )
    if not path.is_file():
        raise DataError(message("{path}: is not a file", path=path), "Name a session file, such as session.h5")
    try:
        file = h5py.File(path, "r", rdcc_nbytes=_CHUNK_CACHE_BYTES)
    except (OSError, RuntimeError) as error:
        raise _cannot_open(path, error) from error
    with file:
        yield file


def is_unfinished(path: Path) -> bool:
    """Whether a file begins as a journal."""
    if not path.is_file():
        return False
    try:
        with path.open("rb") as file:
            return file.read(len(MAGIC)) == MAGIC
    except OSError:
        return False


def _cannot_open(path: Path, error: BaseException) -> DataError:
    text = str(error)
    if "unable to lock" in text:
        return DataError(
            message("{path}: another program is writing it", path=path), "Wait until the recording has ended"
        )
    if isinstance(error, PermissionError) or "Permission denied" in text:
        return DataError(message("{path}: may not be read", path=path), "Ask for the right to read it")
    if "truncated" in text:
        return DataError(
            message("{path}: is truncated: the end of the file is missing", path=path), "Copy it again from its source"
        )
    return DataError(
        message("{path}: is not an HDF5 file, or is damaged", path=path), "A session file is what draglag recorded"
    )


def check_schema(file: Any, path: Path) -> int:
    """The schema version. Raises DataError for another format or a future version."""
    try:
        name = text_attr(file, "schema")
        version = int_attr(file, "schema_version")
    except DataError as error:
        raise DataError(
            message("{path}: is HDF5 but not a draglag session", path=path), "Name a file that draglag recorded"
        ) from error
    if name != SCHEMA or version < 1:
        raise DataError(
            message("{path}: is HDF5 but not a draglag session", path=path), "Name a file that draglag recorded"
        )
    if version > VERSION:
        raise DataError(
            message(
                "{path}: has schema version {version}, this draglag knows up to {known}",
                path=path,
                version=version,
                known=VERSION,
            ),
            "Install a newer draglag",
        )
    return version


def check_tree(file: Any, path: Path) -> None:
    """Raises DataError for the first problem of ``tree_problems``."""
    for name, problem in tree_problems(file):
        raise DataError(
            message("{path}: /{name} {problem}", path=path, name=name, problem=problem),
            "Nothing was followed or read; use the file as recorded",
        )


def tree_problems(file: Any) -> Iterator[tuple[str, str]]:
    """(name, problem) of every item that no session file has."""
    seen: set[int] = set()
    waiting = [("", file.id, 0)]
    count, claimed = 0, 0
    limit = _WHOLE_LIMIT * file.id.get_filesize() + _SLACK_BYTES
    yield from (("", problem) for problem in _attribute_problems(file.id))
    while waiting:
        prefix, group, depth = waiting.pop()
        if depth > MAX_DEPTH:
            yield prefix, message("is nested too deep")
            continue
        for key, is_here in links(group, MAX_ITEMS - count + 1):
            name = f"{prefix}/{key.decode()}".lstrip("/")
            count += 1
            if count > MAX_ITEMS:
                yield name, message("is one item too many")
                return
            item, problems = _item(group, key, seen) if is_here else (None, [message("is a link to another place")])
            yield from ((name, problem) for problem in problems)
            if isinstance(item, h5g.GroupID):
                waiting.append((name, item, depth + 1))
            elif item is not None:
                claimed += _bytes(item)
                if claimed > limit:
                    yield name, TOO_LARGE
                    return


def _item(group: Any, key: bytes, seen: set[int]) -> tuple[Any, list[str]]:
    item = h5o.open(group, key)
    problems = list(_attribute_problems(item))
    if isinstance(item, h5g.GroupID):
        address = int(h5o.get_info(item).addr)
        if address in seen:
            return None, [*problems, message("is the same group under a second name")]
        seen.add(address)
        return item, problems
    if not isinstance(item, h5d.DatasetID):
        return None, [*problems, message("is a named type")]
    problem = dataset_problem(item)
    return (None, [*problems, problem]) if problem else (item, problems)


def _attribute_problems(item: Any) -> Iterator[str]:
    if h5a.get_num_attrs(item) > _MAX_ATTRIBUTES:
        yield message("has too many attributes")
        return
    for key, size in attribute_sizes(item):
        if size > _MAX_ATTRIBUTE_BYTES and key not in _OF_SCALES:
            text = short_text(key.decode())
            yield message("has the attribute {attribute} of {size} bytes", attribute=text, size=size)


def _bytes(dataset: Any) -> int:
    return int(math.prod(dataset.shape) * dataset.dtype.itemsize)


def dataset_problem(dataset: Any) -> str:
    """The problem of an open dataset (h5py's DatasetID), or empty; nothing is read."""
    kind, shape = dataset.dtype, dataset.shape
    plist = dataset.get_create_plist()
    if kind.kind not in "iufS" or kind.hasobject or kind.fields or kind.subdtype or h5py.check_enum_dtype(kind):
        return message("has a type no session file has ({kind})", kind=kind)
    if plist.get_external_count() or plist.get_layout() == h5d.VIRTUAL:
        return message("keeps its data in another file")
    filters = plist.get_nfilters()
    if not {plist.get_filter(k)[0] for k in range(filters)} <= _FILTERS:
        return message("is packed with a filter this program does not load")
    if shape is None or len(shape) > 1:
        return message("is not a column of numbers")
    size, stored = _bytes(dataset), dataset.get_storage_size()
    packed = _DEFLATE_LIMIT if filters else 1
    if size > MAX_BYTES or size > packed * stored + 2**20:
        return message("claims {size} bytes and holds {stored}", size=size, stored=stored)
    return ""


def read_attr(item: Any, key: str) -> Value:
    """An attribute. Raises DataError where it is not one number or text."""
    name = key.encode()
    if not h5a.exists(item.id, name):
        raise DataError(message("{group} has no attribute {key}", group=item.name, key=key))
    handle = h5a.open(item.id, name)
    if handle.shape not in ((), (1,)) or handle.get_storage_size() > _MAX_ATTRIBUTE_BYTES:
        raise DataError(message("{group}: the attribute {key} is not one value", group=item.name, key=key))
    value = attribute(item.id, name)
    if isinstance(value, np.ndarray) and value.shape == (1,):
        value = value[0]
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if isinstance(value, str):
        return value
    if isinstance(value, np.integer | int):
        return int(value)
    if isinstance(value, np.floating | float):
        return float(value)
    raise DataError(message("{group}: the attribute {key} is neither number nor text", group=item.name, key=key))


def text_attr(item: Any, key: str, default: str | None = None) -> str:
    if default is not None and key not in item.attrs:
        return default
    value = read_attr(item, key)
    if not isinstance(value, str):
        raise DataError(message("{group}: the attribute {key} is not text", group=item.name, key=key))
    return value


def float_attr(item: Any, key: str) -> float:
    value = read_attr(item, key)
    if isinstance(value, str):
        raise DataError(message("{group}: the attribute {key} is not a number", group=item.name, key=key))
    return float(value)


def int_attr(item: Any, key: str, default: int | None = None) -> int:
    if default is not None and key not in item.attrs:
        return default
    value = read_attr(item, key)
    if not isinstance(value, int):
        raise DataError(message("{group}: the attribute {key} is not a whole number", group=item.name, key=key))
    return value


def read_columns(group: Any, table: Table) -> dict[str, NDArray[Any]]:
    """Columns as float64, int64 or bytes; an absent optional one is empty.

    Raises DataError on a missing column, another type, or different lengths.
    """
    datasets = readable_columns(group, table)
    return {
        column.name: _values(datasets[column.name], column) if column.name in datasets else np.empty(0, column.dtype)
        for column in table.every()
    }


def readable_columns(group: Any, table: Table) -> dict[str, Any]:
    """Datasets of the columns present; errors as ``read_columns``."""
    if not isinstance(group, h5py.Group):
        raise DataError(message("{group} is not a group", group=group.name))
    found = {}
    for column in table.every():
        if column.name in group:
            found[column.name] = _readable(group, column)
        elif not column.optional:
            raise DataError(
                message("{group} has no column {column}", group=group.name, column=column.name),
                "Use a file that draglag wrote",
            )
    length = len(found[table.scale.name])
    for name, dataset in found.items():
        if len(dataset) != length:
            raise DataError(
                message(
                    "{group}/{name} has {rows} rows, its scale {length}",
                    group=group.name,
                    name=name,
                    rows=len(dataset),
                    length=length,
                )
            )
    return found


def _readable(group: Any, column: Column) -> Any:
    dataset = group[column.name]
    if not isinstance(dataset, h5py.Dataset) or dataset.ndim != 1:
        raise DataError(message("{group}/{column} is not a column", group=group.name, column=column.name))
    if dataset.dtype.kind not in {"f": "iuf", "i": "iu"}.get(column.kind, "S"):
        raise DataError(
            message(
                "{group}/{column} has the type {found}, expected {wanted}",
                group=group.name,
                column=column.name,
                found=dataset.dtype,
                wanted=column.dtype,
            )
        )
    return dataset


def _values(dataset: Any, column: Column) -> NDArray[Any]:
    values: NDArray[Any] = np.empty(dataset.shape, dataset.dtype)
    if len(values):
        dataset.id.read(h5s.ALL, h5s.ALL, values)
    return values if column.kind.startswith("S") else values.astype(column.dtype, copy=False)


def short(error: BaseException) -> Message:
    """An exception's text on one line."""
    said = message_of(error)
    return said if said and short_text(said) == said else phrase(short_text(said) or type(error).__name__)


def short_text(text: str) -> str:
    """Text on one line, at most 160 characters."""
    return " ".join(text.split())[:160]
