"""What an HDF5 file holds, asked of HDF5 itself: h5py's objects cost most where there are thousands of attributes."""

from __future__ import annotations

from typing import Any

import h5py
import numpy as np
from h5py import h5a, h5i, h5l, h5t

_PLAIN = (h5t.STRING, h5t.INTEGER, h5t.FLOAT)


def links(group: Any, most: int | None = None) -> list[tuple[bytes, bool]]:
    """(name, whether it is an item of this very file) of a group's links, the first ``most`` of them."""
    found: list[tuple[bytes, bool]] = []

    def take(name: bytes, info: Any) -> bool | None:
        found.append((bytes(name), info.type == h5l.TYPE_HARD))
        return True if len(found) == most else None

    group.links.iterate(take, info=True)
    return found


def attribute_sizes(item: Any) -> list[tuple[bytes, int]]:
    """(name, bytes) of every attribute, by name."""
    found: list[tuple[bytes, int]] = []
    h5a.iterate(item, lambda name, info: found.append((bytes(name), info.data_size)), info=True)
    return found


def attribute(item: Any, name: bytes) -> Any:
    """An attribute's value as h5py gives it; texts of fixed length as bytes."""
    handle = h5a.open(item, name)
    kind, shape = handle.get_type(), handle.shape
    if shape is None or not _is_plain(kind):
        return high_level(item).attrs[name]
    values = np.zeros(shape, kind.dtype)
    # What is padded with zeros needs no conversion.
    handle.read(values, kind if kind.get_class() == h5t.STRING and kind.get_strpad() == h5t.STR_NULLPAD else None)
    return values[()] if values.ndim == 0 else values


def high_level(item: Any) -> Any:
    """h5py's object of an open item."""
    kinds = {h5i.GROUP: h5py.Group, h5i.FILE: h5py.File, h5i.DATASET: h5py.Dataset, h5i.DATATYPE: h5py.Datatype}
    return kinds[h5i.get_type(item)](item)


def _is_plain(kind: Any) -> bool:
    return kind.get_class() in _PLAIN and not (kind.get_class() == h5t.STRING and kind.is_variable_str())
