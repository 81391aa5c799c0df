"""What no session file has is named before anything of it is read; checksums are those of what h5py reads."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from draglag.store.checksum import raw_checksum
from draglag.store.safely import tree_problems

ROWS = 150_000  # more than are summed at once, twice


def many_attributes(file: h5py.File) -> None:
    group = file.create_group("g")
    for k in range(1001):
        group.attrs[str(k)] = k


def of_the_same_name(file: h5py.File) -> None:
    file["h"] = file.create_group("g")


def of_a_named_type(file: h5py.File) -> None:
    file["t"] = np.dtype("f8")


def nested(file: h5py.File) -> None:
    file.create_group("/".join("abcdefghij"))


def external_values(file: h5py.File) -> None:
    file.create_dataset("d", (2,), "f8", external=[("other.raw", 0, 16)])


def virtual_values(file: h5py.File) -> None:
    layout = h5py.VirtualLayout((2,), "f8")
    layout[:] = h5py.VirtualSource("other.h5", "d", (2,))
    file.create_virtual_dataset("d", layout)


def never_written(file: h5py.File) -> None:
    file.create_dataset("d", (10**8,), "f8", chunks=(10**6,))


def put(key: str, value: object, **options: object) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        if options:
            file.create_dataset(key, data=value, **options)
        else:
            file[key] = value

    return change


def large_attribute(file: h5py.File) -> None:
    file.attrs["a"] = np.zeros(2**18)  # 2 MiB


PROBLEMS = {
    "a large attribute": (large_attribute, "", "has the attribute a of 2097152 bytes"),
    "many attributes": (many_attributes, "g", "has too many attributes"),
    "a soft link": (put("l", h5py.SoftLink("/g")), "l", "is a link to another place"),
    "an external link": (put("l", h5py.ExternalLink("b.h5", "/")), "l", "is a link to another place"),
    "a second name": (of_the_same_name, "h", "is the same group under a second name"),
    "a named type": (of_a_named_type, "t", "is a named type"),
    "depth": (nested, "a/b/c/d/e/f/g/h/i", "is nested too deep"),
    "another file's values": (external_values, "d", "keeps its data in another file"),
    "virtual values": (virtual_values, "d", "keeps its data in another file"),
    "a foreign filter": (put("d", np.zeros(10), compression="lzf"), "d", "is packed with a filter"),
    "a table": (put("d", np.zeros((2, 2))), "d", "is not a column of numbers"),
    "pairs": (put("d", np.zeros(2, [("a", "f8"), ("b", "f8")])), "d", "has a type no session file has"),
    "values that were never written": (never_written, "d", "claims 800000000 bytes and holds 0"),
}


@pytest.mark.parametrize(("change", "name", "problem"), PROBLEMS.values(), ids=PROBLEMS)
def test_each_thing_that_no_session_file_has_is_named(
    tmp_path: Path, change: Callable[[h5py.File], None], name: str, problem: str
) -> None:
    with h5py.File(tmp_path / "a.h5", "w", libver="latest") as file:
        change(file)
    with h5py.File(tmp_path / "a.h5") as file:
        ((where, found),) = tree_problems(file)
    assert where == name
    assert str(found).startswith(problem)


def test_columns_of_usual_filters_have_no_problem(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("g/d", data=np.arange(100.0), compression="gzip", shuffle=True, fletcher32=True)
        file["g"].attrs["unit"] = "mm"
        file["g"].attrs["remark of another program"] = h5py.Empty("f8")
        assert list(tree_problems(file)) == []


@pytest.mark.parametrize("row", [None, 0, 65_536, ROWS - 1])
def test_a_checksum_is_that_of_all_that_h5py_reads(tmp_path: Path, row: int | None) -> None:
    values = np.arange(float(ROWS))
    with h5py.File(tmp_path / "a.h5", "w") as file:
        column = file.create_dataset("runs/run-01/touch/x_mm", data=values, chunks=(1000,), compression="gzip")
        column.attrs["unit"], file["runs"].attrs["count"] = "mm", 1
        file["protocol_toml"] = np.bytes_("name = 'ä'".encode())
        before = raw_checksum(file)
        if row is not None:
            column[row] = -1.0
        assert (raw_checksum(file) == before) == (row is None)
        assert raw_checksum(file) == _by_h5py(file)


def _by_h5py(file: h5py.File) -> str:
    digest = hashlib.sha256()

    def attributes(item: h5py.Group | h5py.Dataset) -> None:
        for key in sorted(item.attrs):
            value = item.attrs[key]
            digest.update(f"{key}={value.decode() if isinstance(value, bytes) else value!s}\0".encode())

    attributes(file)
    for name in ("runs", "runs/run-01", "runs/run-01/touch", "runs/run-01/touch/x_mm", "protocol_toml"):
        item = file[name]
        digest.update(item.name.encode() + b"\0")
        attributes(item)
        if isinstance(item, h5py.Dataset):
            digest.update(item.dtype.str.encode() + repr(item.shape).encode() + item[()].tobytes())
    return digest.hexdigest()
