"""CSV columns of numbers, plain or gzipped."""

from __future__ import annotations

import csv
import gzip
import io
import math
import re
from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from draglag.errors import DataError
from draglag.messages import message
from draglag.reading.files import decoded, plain_lines
from draglag.store.stored import blocks

MISSING = ("", "na", "nan", "+nan", "-nan")  # what other programs write for a missing number, in small letters
SWITCHED = {"true": 1.0, "false": 0.0}
_QUOTED = re.compile('"[^"]*"')


def find_table(folder: Path, stem: str) -> Path | None:
    """``<stem>.csv`` or ``<stem>.csv.gz``. Raises DataError where both exist."""
    found = [path for path in (folder / f"{stem}.csv", folder / f"{stem}.csv.gz") if path.is_file()]
    if len(found) > 1:
        raise DataError(
            message("{path}: exists in addition to {other}", path=found[0], other=found[1].name),
            "Remove the one that is out of date",
        )
    return found[0] if found else None


def read_table(path: Path, columns: Sequence[str], switches: Sequence[str] = ()) -> NDArray[np.float64]:
    """The named columns, (n, len(columns)), of a CSV file; NaN for cells that are empty, ``NA`` or ``NaN``.

    switches: those of the columns in which ``True`` and ``False`` are 1 and 0. Raises DataError naming file and line.
    """
    text = _text(path)
    if not text.strip():
        return np.empty((0, len(columns)))
    head, _, body = text.partition("\n")
    names = _names(head, ",")
    expected = ",".join(columns)
    missing = [name for name in columns if name not in names]
    if missing:
        raise DataError(
            message(
                "{path}, line 1: expected the header {expected}, found “{found}”",
                path=path,
                expected=expected,
                found=head.strip()[:80],
            ),
            "Write the column names in the first line",
        )
    if not body.strip():
        return np.empty((0, len(columns)))
    wanted = [_place(path, 1, names, name) for name in columns]
    try:
        values = np.loadtxt(io.StringIO(body), delimiter=",", ndmin=2, comments=None)
    except ValueError:
        return _by_cell(path, text, names, columns, switches)
    if values.shape[1] != len(names):
        return _by_cell(path, text, names, columns, switches)
    table: NDArray[np.float64] = values[:, wanted]
    return table


def _by_cell(
    path: Path, text: str, names: Sequence[str], columns: Sequence[str], switches: Sequence[str]
) -> NDArray[np.float64]:
    """As ``read_table``, of cells that may be missing, in quotes, or of text in columns that are not asked for."""
    wanted = [(name, _place(path, 1, names, name)) for name in columns]
    values = array("d")
    rows = _rows(path, _filled(text), ",", '"' in text)
    next(rows)
    for number, cells in rows:
        if len(cells) != len(names):
            raise _wrong_cells(path, number, names, len(cells))
        for name, place in wanted:
            value = _number(cells[place], switch=name in switches)
            if math.isnan(value) and _bare(cells[place]).lower() not in MISSING:
                raise DataError(
                    message(
                        "{path}, line {line}: expected a number for {name}, found “{text}”",
                        path=path,
                        line=number,
                        name=name,
                        text=cells[place].strip()[:40],
                    ),
                    "Correct or remove that line",
                )
            values.append(value)
    return np.array(values).reshape(-1, len(columns))


def column_names(path: Path) -> tuple[str, ...]:
    """Names in the first line."""
    return tuple(_names(_text(path).partition("\n")[0], ","))


def read_events(
    path: Path,
    columns: Sequence[str],
    perhaps: Sequence[str] = (),
    switches: Sequence[str] = (),
    names_in: Sequence[str] = (),
) -> NDArray[np.float64]:
    """The named columns, (n, columns and perhaps), of another program's CSV; NaN for cells without a number.

    perhaps: further columns, NaN where the file has none of that name. switches: as for ``read_table``. names_in: those
    of the columns that hold names; where one is no number, each is numbered from 0 in their order.

    Lines beginning with # are skipped. Separators: commas, or tabs or semicolons with decimal commas. Raises DataError.
    """
    first, names, rows, between = _events(path)
    missing = [name for name in columns if name not in names]
    if missing:
        raise DataError(
            message("{path}: no column {column} in its first line", path=path, column=missing[0]),
            message("Head the columns {columns}", columns=",".join(columns)),
        )
    there = [name for name in perhaps if name in names]
    wanted = [(_place(path, first, names, name), name in switches) for name in (*columns, *there)]
    named = {k: Names() for k, name in enumerate((*columns, *there)) if name in names_in}
    comma = between != ","
    values = array("d")
    for number, cells in rows:
        if len(cells) != len(names):
            raise _wrong_cells(path, number, names, len(cells))
        values.extend(
            named[k].code(cells[place]) if k in named else _number(cells[place], comma, switch)
            for k, (place, switch) in enumerate(wanted)
        )
    read = np.array(values).reshape(-1, len(wanted))
    for k, seen in named.items():
        read[:, k] = seen.numbers(comma)[read[:, k].astype(int)]
    table = np.full((len(read), len(columns) + len(perhaps)), np.nan)
    table[:, [*range(len(columns)), *(len(columns) + perhaps.index(name) for name in there)]] = read
    return table


def event_columns(path: Path) -> tuple[str, ...]:
    """Names of the columns of ``read_events``. Raises DataError."""
    return tuple(_events(path)[1])


def _events(path: Path) -> tuple[int, list[str], Iterator[tuple[int, list[str]]], str]:
    """Line and names of the columns of another program's table, its rows as ``_rows``, and its separator."""
    text = _text(path)
    between = _separator(text)
    rows = _rows(path, _filled(text, notes=True), between, '"' in text)
    first, head = next(rows, (1, [""]))
    return first, [_bare(name) for name in head], rows, between


def _filled(text: str, notes: bool = False) -> Iterator[tuple[int, str]]:
    """(number from 1, line) of lines that are not blank; with ``notes``, nor begin with #."""
    for number, line in enumerate(_lines(text), 1):
        if line.strip() and not (notes and line.startswith("#")):
            yield number, line


def _lines(text: str) -> Iterator[str]:
    """One by one: a list of all takes several times the memory of the text."""
    start = 0
    while (end := text.find("\n", start)) >= 0:
        yield text[start:end]
        start = end + 1
    yield text[start:]


def _rows(path: Path, lines: Iterable[tuple[int, str]], between: str, quoted: bool) -> Iterator[tuple[int, list[str]]]:
    """(number of its first line, cells) of each row; those in quotes may hold separators and line ends."""
    if not quoted:
        for number, line in lines:
            yield number, line.split(between)
        return
    taken: list[int] = []

    def given() -> Iterator[str]:
        for number, line in lines:
            taken.append(number)
            yield line + "\n"

    try:
        for cells in csv.reader(given(), delimiter=between, skipinitialspace=True):
            yield taken[0], cells
            taken.clear()
    except csv.Error as error:
        raise DataError(
            message("{path}, line {line}: its quotes do not end", path=path, line=taken[0]), "Correct that line"
        ) from error


def _separator(text: str) -> str:
    """What stands between the cells of the first line that is no note."""
    head = _QUOTED.sub("", next((line for _, line in _filled(text, notes=True)), ""))
    return next((mark for mark in (";", "\t", ",") if mark in head), ",")


def _names(head: str, between: str) -> list[str]:
    return [_bare(name) for name in next(csv.reader([head], delimiter=between, skipinitialspace=True), [""])]


def _bare(cell: str) -> str:
    return cell.strip().strip('"').strip()


def _place(path: Path, line: int, names: Sequence[str], name: str) -> int:
    """Where the column of that name stands. Raises DataError where two have it."""
    if names.count(name) > 1:
        raise DataError(
            message("{path}, line {line}: there are {n} columns {column}", path=path, line=line, n=names.count(name),
                    column=name),
            "Give each column a name of its own",
        )  # fmt: skip
    return names.index(name)


def _wrong_cells(path: Path, line: int, names: Sequence[str], found: int) -> DataError:
    return DataError(
        message(
            "{path}, line {line}: expected {wanted} cells ({names}), found {found}",
            path=path,
            line=line,
            wanted=len(names),
            names=",".join(names),
            found=found,
        ),
        "Correct or remove that line",
    )


class Names:
    """Distinct texts of a column."""

    def __init__(self) -> None:
        self._codes: dict[str, int] = {}

    def code(self, cell: str) -> int:
        """Place of the cell's text among the distinct ones."""
        return self._codes.setdefault(_bare(cell), len(self._codes))

    def numbers(self, comma: bool) -> NDArray[np.float64]:
        """The number of each code, NaN for a missing one: what the texts say, or 0, 1, 2 … where one says none."""
        there = np.array([text.lower() not in MISSING for text in self._codes], bool)
        said = np.array([_number(text, comma) for text in self._codes])
        if np.isnan(said[there]).any():
            said[there] = np.arange(there.sum())
        return said


def _number(cell: str, comma: bool = False, switch: bool = False) -> float:
    text = _bare(cell)
    try:
        return float(text.replace(",", ".") if comma else text)
    except ValueError:
        return SWITCHED.get(text.lower(), math.nan) if switch else math.nan


def line_of_row(path: Path, row: int, notes: bool = False) -> int:
    """Line (from 1) of a row of ``read_table``; with ``notes``, of ``read_events``."""
    text = _text(path)
    between = _separator(text) if notes else ","
    first = [number for number, _ in _rows(path, _filled(text, notes), between, '"' in text)]
    return first[row + 1]


Cells = NDArray[Any] | list[str] | str
"""A column to write: numbers, texts, or one text for every row."""


def write_table(path: Path, columns: Mapping[str, Cells]) -> None:
    """Write a CSV file, gzipped if named .gz, that restores floats exactly."""
    write_parts(path, tuple(columns), [columns])


def write_parts(path: Path, names: Sequence[str], parts: Iterable[Mapping[str, Cells]], unknown: str = "nan") -> None:
    """Write rows part after part, a block at a time in memory; ``unknown``: the text for NaN."""
    with ExitStack() as stack:
        file: IO[bytes] | gzip.GzipFile = stack.enter_context(path.open("wb"))
        if path.suffix == ".gz":
            file = stack.enter_context(gzip.GzipFile("", "wb", 6, file, mtime=0))
        file.write((",".join(names) + "\n").encode())
        for part in parts:
            length = max((len(values) for values in part.values() if not isinstance(values, str)), default=0)
            for rows in blocks(length):
                count = rows.stop - rows.start
                cells = [_cells(part.get(name, ""), rows, count, unknown) for name in names]
                file.write("".join(",".join(row) + "\n" for row in zip(*cells, strict=True)).encode())


def _cells(values: Cells, rows: slice, count: int, unknown: str) -> list[str]:
    if isinstance(values, str):
        return [values] * count
    if isinstance(values, list):
        return values[rows]
    block = values[rows]
    cells = list(map(repr, block.tolist()))
    if block.dtype.kind == "f":
        for k in np.flatnonzero(np.isnan(block)):
            cells[k] = unknown
    return cells


def _text(path: Path) -> str:
    return decoded(path, plain_lines(path))
