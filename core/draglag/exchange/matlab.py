"""A MATLAB file (level 5): one struct ``session`` with the groups and columns of a session file."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import savemat

from draglag.errors import DataError
from draglag.recording import Session
from draglag.store.build import publish
from draglag.store.schema import distinct, session_nodes
from draglag.temporary import temporary_for


def write_mat(session: Session, path: Path | str) -> Path:
    """Write a session for ``load`` of MATLAB and Octave: ``session.runs.run_01.touch.x_mm`` is a column vector.

    Names become valid MATLAB names (the true id of a run is its field ``id``). Raises DataError.
    """
    path = Path(path)
    if path.exists():
        raise DataError(f"{path}: exists already and is not overwritten", "Choose another name")
    root: dict[str, Any] = {}
    fields: dict[tuple[str, ...], str] = {}
    for node in distinct(session_nodes(session)):
        place = root
        names = tuple(filter(None, node.path.split("/")))
        for depth in range(1, len(names) + 1):
            place = place.setdefault(_field(names[:depth], fields), {})
        if re.fullmatch(r"runs/[^/]+", node.path):
            place["id"] = node.path.split("/")[1]
        for key, value in {**node.attrs, **node.counts, **node.texts}.items():
            place[_name(key)] = value
        for key, values in node.rows.items():
            place[_name(key)] = (
                np.array([value.decode() for value in values.tolist()], object) if values.dtype.kind == "S" else values
            )
    try:
        with temporary_for(path) as growing:
            with growing.open("wb") as file:
                savemat(file, {"session": root}, long_field_names=True, do_compression=True, oned_as="column")
            publish(growing, path)
    except OSError as error:
        raise DataError(f"{path}: cannot be written ({error.strerror})", "Check the folder and free space") from error
    return path


def _field(names: tuple[str, ...], fields: dict[tuple[str, ...], str]) -> str:
    """The struct field of a group; two groups whose names read the same in MATLAB get a field each."""
    if names not in fields:
        taken = {field for other, field in fields.items() if other[:-1] == names[:-1]}
        wanted = field = _name(names[-1])
        number = 2
        while field in taken:
            field, number = f"{wanted}_{number}", number + 1
        fields[names] = field
    return fields[names]


def _name(text: str) -> str:
    """A valid MATLAB name of at most 63 characters."""
    name = re.sub(r"\W", "_", text, flags=re.ASCII)[:60]
    return name if name[:1].isalpha() else f"x{name}"
