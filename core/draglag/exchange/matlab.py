"""A MATLAB file (level 5), structured as a session file."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import chain
from pathlib import Path
from typing import IO, Any

import numpy as np
from scipy.io import savemat
from scipy.io.matlab import MatWriteError

from draglag.errors import DataError, cause
from draglag.messages import message
from draglag.recording import Session
from draglag.store.analysis import StoredAnalysis, result_nodes
from draglag.store.session_nodes import distinct, session_nodes
from draglag.system.temporary import new_file

_COMPRESSED_BYTES = 16 * 2**20
"""Largest column that is compressed, bytes: compression holds it twice in memory."""


def write_mat(session: Session, path: Path | str, results: Sequence[StoredAnalysis] = ()) -> Path:
    """The file for MATLAB and Octave: ``session.runs.run_01.touch.x_mm`` is a column vector,
    ``session.runs.run_01.touch.units.x_mm`` its unit, ``session.analysis.x1`` a stored result.

    ``id`` is a run's true id. Texts beyond ASCII end with blanks (``strtrim``). Raises DataError, also beyond 4 GiB.
    """
    path = Path(path)
    root: dict[str, Any] = {}
    fields: dict[tuple[str, ...], str] = {}
    size = 0
    for node in distinct(chain(session_nodes(session), *map(result_nodes, results))):
        place = root
        names = tuple(filter(None, node.path.split("/")))
        for depth in range(1, len(names) + 1):
            place = place.setdefault(_field(names[:depth], fields), {})
        if re.fullmatch(r"runs/[^/]+", node.path):
            place["id"] = _text(node.path.split("/")[1])
        for key, value in {**node.attrs, **node.counts, **node.texts}.items():
            place[_name(key)] = _text(value) if isinstance(value, str) else value
        if node.table is not None:
            place["units"] = {_name(column.name): _text(column.units) for column in node.table.every()}
        for key, values in node.rows.items():
            size += values.nbytes
            place[_name(key)] = (
                np.array([_text(value.decode()) for value in values.tolist()], object)
                if values.dtype.kind == "S"
                else values
            )
    try:
        with new_file(path) as growing, growing.open("wb") as file:
            _save(file, root, compress=size <= _COMPRESSED_BYTES)
    except MatWriteError as error:
        raise DataError(
            message("{path}: the session is larger than the 4 GiB of a MATLAB file", path=path), "Export to netcdf"
        ) from error
    except OSError as error:
        raise DataError(
            message("{path}: cannot be written ({why})", path=path, why=cause(error)), "Check the folder and free space"
        ) from error
    return path


def _text(text: str) -> str:
    """The text with a blank for every byte that its UTF-8 has more than it has characters.

    The file counts characters, and Octave reads as many bytes: it would lose the end.
    """
    return text + " " * (len(text.encode()) - len(text))


def _save(file: IO[bytes], root: dict[str, Any], compress: bool) -> None:
    savemat(file, {"session": root}, long_field_names=True, do_compression=compress, oned_as="column")


def _field(names: tuple[str, ...], fields: dict[tuple[str, ...], str]) -> str:
    if names not in fields:
        taken = {field for other, field in fields.items() if other[:-1] == names[:-1]}
        wanted = field = _name(names[-1])
        number = 2
        while field in taken:
            field, number = f"{wanted}_{number}", number + 1
        fields[names] = field
    return fields[names]


def _name(text: str) -> str:
    name = re.sub(r"\W", "_", text, flags=re.ASCII)[:60]
    return name if name[:1].isalpha() else f"x{name}"
