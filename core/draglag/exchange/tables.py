"""CSV columns of numbers, plain or gzipped."""

from __future__ import annotations

import gzip
import io
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from draglag.errors import DataError
from draglag.messages import message
from draglag.reading.files import decoded, plain_lines
from draglag.store.stored import blocks


def find_table(folder: Path, stem: str) -> Path | None:
    """``<stem>.csv`` or ``<stem>.csv.gz``. Raises DataError where both exist."""
    found = [path for path in (folder / f"{stem}.csv", folder / f"{stem}.csv.gz") if path.is_file()]
    if len(found) > 1:
        raise DataError(
            message("{path}: exists in addition to {other}", path=found[0], other=found[1].name),
            "Remove the one that is out of date",
        )
    return found[0] if found else None


def read_table(path: Path, columns: Sequence[str]) -> NDArray[np.float64]:
    """The named columns, (n, len(columns)), of a CSV file. Raises DataError naming file and line."""
    text = _text(path)
    if not text.strip():
        return np.empty((0, len(columns)))
    head, _, body = text.partition("\n")
    names = [name.strip().strip('"') for name in head.split(",")]
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
    wanted = [names.index(name) for name in columns]
    try:
        values = np.loadtxt(io.StringIO(body), delimiter=",", ndmin=2, comments=None)
    except ValueError:
        _refuse(path, body, names)
    if values.shape[1] != len(names):
        _refuse(path, body, names)
    table: NDArray[np.float64] = values[:, wanted]
    return table


def column_names(path: Path) -> tuple[str, ...]:
    """Names in the first line."""
    return tuple(name.strip().strip('"') for name in _text(path).partition("\n")[0].split(","))


def read_events(path: Path, columns: Sequence[str], perhaps: Sequence[str] = ()) -> NDArray[np.float64]:
    """The named columns, (n, columns and perhaps), of another program's CSV; NaN for cells without a number.

    perhaps: further columns, NaN where the file has none of that name.

    Lines beginning with # are skipped. Separators: commas, tabs, or semicolons with decimal commas. Raises DataError.
    """
    lines = _text(path).split("\n")
    first = next((k for k, line in enumerate(lines) if line.strip() and not line.startswith("#")), 0)
    between = next((mark for mark in (";", "\t", ",") if mark in lines[first]), ",")
    names = [name.strip().strip('"') for name in lines[first].split(between)]
    missing = [name for name in columns if name not in names]
    if missing:
        raise DataError(
            message("{path}: no column {column} in its first line", path=path, column=missing[0]),
            message("Head the columns {columns}", columns=",".join(columns)),
        )
    there = [name for name in perhaps if name in names]
    wanted = [names.index(name) for name in (*columns, *there)]
    rows = []
    for number, line in enumerate(lines[first + 1 :], first + 2):
        if not line.strip() or line.startswith("#"):
            continue
        cells = line.split(between)
        if len(cells) != len(names):
            raise _wrong_cells(path, number, names, len(cells))
        rows.append([_number(cells[place], comma=between == ";") for place in wanted])
    table = np.full((len(rows), len(columns) + len(perhaps)), np.nan)
    places = [*range(len(columns)), *(len(columns) + perhaps.index(name) for name in there)]
    table[:, places] = np.array(rows, float).reshape(-1, len(wanted))
    return table


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


def _number(cell: str, comma: bool) -> float:
    text = cell.strip().strip('"')
    try:
        return float(text.replace(",", ".") if comma else text)
    except ValueError:
        return float("nan")


def line_of_row(path: Path, row: int, notes: bool = False) -> int:
    """Line (from 1) of a row of ``read_table``; with ``notes``, of ``read_events``."""
    lines = enumerate(_text(path).split("\n"), 1)
    filled = [number for number, line in lines if line.strip() and not (notes and line.startswith("#"))]
    return filled[row + 1]


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


def _refuse(path: Path, body: str, names: Sequence[str]) -> NoReturn:
    for number, line in enumerate(body.split("\n"), 2):
        if not line.strip():
            continue
        cells = line.split(",")
        if len(cells) != len(names):
            raise DataError(
                message(
                    "{path}, line {line}: expected {wanted} numbers ({names}), found {found}",
                    path=path,
                    line=number,
                    wanted=len(names),
                    names=",".join(names),
                    found=len(cells),
                ),
                "Correct or remove that line",
            )
        for name, cell in zip(names, cells, strict=True):
            try:
                float(cell)
            except ValueError:
                raise DataError(
                    message(
                        "{path}, line {line}: expected a number for {name}, found “{text}”",
                        path=path,
                        line=number,
                        name=name,
                        text=cell.strip()[:40],
                    ),
                    "Correct or remove that line",
                ) from None
    raise DataError(
        message("{path}: holds something other than numbers", path=path),
        message("Expected columns {names}", names=",".join(names)),
    )
