"""Session files changed in their structure: what can be done to each item of an HDF5 file, and a reader under it.

An input is a list of changes, five bytes each: which change, to which item, with which number.
"""

from __future__ import annotations

import shutil
import zlib
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from core.store_sessions import assert_same, bare_session, full_run, full_session
from draglag.errors import DataError
from draglag.recording import Session
from draglag.store import read_analyses, read_session, salvage, verify, write_session
from draglag.store.read import CHANGED
from fuzz.readers import Reader

SECRET = "/etc/passwd"
CHANGE_BYTES = 5
MOST_CHANGES = 3

Move = Callable[[Any, str, int], None]


def sound_session(path: Path) -> tuple[Session, list[str]]:
    """A session, written to the path, and the names of all items of its file."""
    session = replace(bare_session(full_run("run-01", 10.0)), taps=full_session().taps, notes=full_session().notes)
    write_session(session, path)
    names: list[str] = [""]
    with h5py.File(path) as file:
        file.visit(names.append)
    return session, names


# --- what can be done to an item of an HDF5 file; each takes the file, the item's name and a number ---


def _delete(file: Any, name: str, number: int) -> None:
    del file[name]


def _soft_link(file: Any, name: str, number: int) -> None:
    del file[name]
    file[name] = h5py.SoftLink(("/", "/runs", f"/{name}", "/none")[number % 4])


def _external_link(file: Any, name: str, number: int) -> None:
    del file[name]
    file[name] = h5py.ExternalLink(SECRET, "/")


def _hard_link(file: Any, name: str, number: int) -> None:
    target = file[("/", "/runs", "/screen", "/runs/run-01/touch/time")[number % 4]]
    del file[name]
    file[name] = target


def _virtual(file: Any, name: str, number: int) -> None:
    del file[name]
    layout = h5py.VirtualLayout((200,), "f8")
    layout[:] = h5py.VirtualSource(SECRET if number % 2 else ".", "runs/run-01/touch/x_mm", (200,))
    file.create_virtual_dataset(name, layout)


def _outside(file: Any, name: str, number: int) -> None:
    del file[name]
    file.create_dataset(name, (200,), "f8", external=[(SECRET, 0, 1600)])


@cache
def _zeros() -> bytes:
    return zlib.compress(bytes(8 * 2**20), 1)


def _bomb(file: Any, name: str, number: int) -> None:
    """Zeros that pack a thousandfold, 64 MB in 64 kB; or room that was never filled."""
    del file[name]
    if number % 2:
        file.create_dataset(name, (2**40,), "f8", chunks=(2**16,))
        return
    data = file.create_dataset(name, (2**23,), "f8", chunks=(2**20,), compression="gzip", compression_opts=1)
    for chunk in range(8):
        data.id.write_direct_chunk((chunk * 2**20,), _zeros())


def _other_kind(file: Any, name: str, number: int) -> None:
    del file[name]
    kinds = ("f4", "i1", "u8", "S3", "?", "c16", "f2", h5py.vlen_dtype("i4"), h5py.string_dtype(), [("a", "f8")])
    file.create_dataset(name, (200,), kinds[number % len(kinds)])


def _other_shape(file: Any, name: str, number: int) -> None:
    del file[name]
    shapes: tuple[Any, ...] = ((), (0,), (1,), (200, 1), (199,), (10, 10, 2), None)
    shape = shapes[number % len(shapes)]
    file.create_dataset(name, data=h5py.Empty("f8")) if shape is None else file.create_dataset(name, shape, "f8")


def _group_instead(file: Any, name: str, number: int) -> None:
    del file[name]
    file.create_group(name)


def _values(file: Any, name: str, number: int) -> None:
    item = file[name]
    if isinstance(item, h5py.Dataset) and item.dtype.kind in "fi" and item.shape:
        values: tuple[Any, ...] = (np.nan, np.inf, -np.inf, 1e300, -1.0, 0.0, 2.0**62)
        value = values[number % len(values)]
        item[number % max(1, item.shape[0])] = value if item.dtype.kind == "f" or np.isfinite(value) else -(2**63)


def _attribute(file: Any, name: str, number: int) -> None:
    item = file[name] if name else file
    keys = [key for key in item.attrs if key not in ("DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME")]
    key = keys[number % len(keys)] if keys else "new"
    values: tuple[Any, ...] = (
        np.nan, np.inf, 1e308, -1, 2**62, 0, "", "x" * 60_000, b"\xff\xfe", np.zeros(100), np.array([], "f8"),
        "\u202e", h5py.Empty("f8"), np.array([b"a", b"b"]), file.ref, True,
    )  # fmt: skip
    with suppress(KeyError):
        del item.attrs[key]
    if number % 17:
        item.attrs[key] = values[number % len(values)]


def _many(file: Any, name: str, number: int) -> None:
    item = file[name] if name else file
    if isinstance(item, h5py.Group):
        for k in range(1200):
            item.attrs[f"many {k}"] = k


def _deep(file: Any, name: str, number: int) -> None:
    file.create_group((name + "/" if isinstance(file.get(name or "/"), h5py.Group) else "") + "/".join("d" * 30))


MOVES = (
    _delete, _soft_link, _external_link, _hard_link, _virtual, _outside, _other_kind, _other_shape, _group_instead,
    _values, _attribute, _attribute, _many, _deep, _bomb,
)  # fmt: skip


def change(sound: Path, changed: Path, names: list[str], changes: list[tuple[Move, int, int]]) -> None:
    """Write a copy of the sound file with these changes, each a move, the place of its item and a number."""
    changed.unlink(missing_ok=True)
    shutil.copyfile(sound, changed)
    with h5py.File(changed, "r+") as file:
        for move, which, number in changes:
            name = names[which % len(names)] or ("" if move in (_attribute, _many, _deep) else "screen")
            with suppress(LookupError, OSError, RuntimeError, ValueError, TypeError, AttributeError, OverflowError):
                move(file, name, number)


def outcome_of(action: Callable[[Path], Any], path: Path) -> tuple[Any, DataError | None]:
    """What an action returned, or the one error that it may raise."""
    try:
        return action(path), None
    except DataError as error:
        return None, error


def refused_or_noticed(path: Path, session: Session) -> DataError | None:
    """The refusal, in one sentence; None for a file read with a remark, or in which nothing measured is changed."""
    findings = verify(path)
    read, refused = outcome_of(read_session, path)
    if refused is not None:
        assert "\n" not in str(refused)
        assert str(refused).startswith(f"{path}: ")
        assert refused.remedy
        assert any(finding.level == "error" for finding in findings)
        return refused
    if not any(note.text == CHANGED for note in read.notes):
        assert_same(read.runs, session.runs)
        assert_same(read.taps, session.taps)
    return None


def use_elsewhere(changed: Path, saved: Path) -> None:
    """Read the analyses and salvage the file: each is done or refused; nothing of another file is shown."""
    saved.unlink(missing_ok=True)
    for action in (lambda: read_analyses(changed), lambda: salvage(changed, saved)):
        with suppress(DataError):
            action()
    assert "root:" not in "".join(str(finding) for finding in verify(changed))


def changed_session(scratch: Path) -> Reader:
    """A session file under changes of its structure."""
    sound = scratch / "sound.h5"
    session, names = sound_session(sound)

    def read(path: Path) -> None:
        data = path.read_bytes()
        changed = path.with_suffix(".h5")
        changes = []
        for at in range(0, min(len(data), CHANGE_BYTES * MOST_CHANGES) - CHANGE_BYTES + 1, CHANGE_BYTES):
            which, number = (int.from_bytes(data[k : k + 2], "little") for k in (at + 1, at + 3))
            changes.append((MOVES[data[at] % len(MOVES)], which, number))
        change(sound, changed, names, changes)
        refused = refused_or_noticed(changed, session)
        if sum(data) % 8 == 0:  # costs as much as five readings
            use_elsewhere(changed, path.with_suffix(".saved.h5"))
        if refused is not None:
            raise refused

    nothing, note = b"", bytes([MOVES.index(_attribute), 0, 0, 0, 0])
    return Reader("session file", "changes.bin", (nothing, note), read)
