"""Removal of what killed commands left."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from draglag.system.temporary import sweep

# As draglag.store names them.
_UNFINISHED, _BUILDING = ".partial", ".tmp"


def sweep_for(arguments: Sequence[str]) -> list[Path]:
    """Files removed from the present folder and the arguments'.

    Leftovers of recordings stay if an argument is an unfinished one.
    """
    names = [os.path.abspath(text.rpartition("=")[2]) for text in arguments if "\0" not in text]
    try:
        folders = {os.getcwd(), *map(os.path.dirname, names), *filter(os.path.isdir, names)}
    except OSError:  # the present folder was removed
        return []
    gone = [path for folder in sorted(folders) for path in sweep(Path(folder))]
    if not any(name.endswith(_UNFINISHED) for name in names):
        gone += [path for folder in sorted(folders) if _has_leftovers(folder) for path in _clear(folder)]
    return gone


def _has_leftovers(folder: str) -> bool:
    try:
        names = set(os.listdir(folder))
    except OSError:
        return False
    return any(
        (name.startswith(".") and name.endswith(_BUILDING)) or name.removesuffix(_UNFINISHED) in names - {name}
        for name in names
    )


def _clear(folder: str) -> list[Path]:
    from draglag.store import clear_leftovers

    return clear_leftovers(folder)
