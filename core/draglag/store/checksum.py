"""A checksum of the raw data, independent of HDF5's layout."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np
from h5py import h5i, h5o, h5s

from draglag.store.items import attribute, attribute_sizes, high_level, links
from draglag.store.nexus import ATTRIBUTES
from draglag.store.schema import RAW_GROUPS

_NOT_MEASURED = {"DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME", "raw_sha256"}

_ROWS = 1 << 16  # read at once


def raw_checksum(file: Any) -> str:
    """SHA-256 (hex) of names, attributes and values."""
    digest = hashlib.sha256()
    _add_attrs(digest, file.id)
    for name in (*RAW_GROUPS, "protocol_toml"):
        if name in file:
            _add(digest, file[name].id)
    return digest.hexdigest()


def _add(digest: Any, item: Any) -> None:
    digest.update(h5i.get_name(item) + b"\0")
    _add_attrs(digest, item)
    if h5i.get_type(item) == h5i.DATASET:
        _add_values(digest, item)
    else:
        for name in sorted(name for name, _ in links(item)):
            _add(digest, h5o.open(item, name))


def _add_values(digest: Any, dataset: Any) -> None:
    shape, kind = dataset.shape, dataset.dtype
    digest.update(kind.str.encode() + repr(shape).encode())
    if len(shape) != 1:
        digest.update(high_level(dataset)[()].tobytes())
        return
    for first in range(0, shape[0], _ROWS):
        values = np.empty(min(_ROWS, shape[0] - first), kind)
        memory = rows = h5s.ALL
        if len(values) < shape[0]:
            memory, rows = h5s.create_simple(values.shape), dataset.get_space()
            rows.select_hyperslab((first,), values.shape)
        dataset.read(memory, rows, values)
        digest.update(values)


def _add_attrs(digest: Any, item: Any) -> None:
    names = {name.decode(): name for name, _ in attribute_sizes(item)}
    plot = ATTRIBUTES if "NX_class" in names else ()
    for key in sorted(set(names) - _NOT_MEASURED - set(plot)):
        value = attribute(item, names[key])
        text = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
        digest.update(f"{key}={text!s}\0".encode())
