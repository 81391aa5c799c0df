"""A checksum of the raw data, independent of HDF5's layout."""

from __future__ import annotations

import hashlib
from typing import Any

import h5py

from draglag.store.nexus import ATTRIBUTES
from draglag.store.schema import RAW_GROUPS

_NOT_MEASURED = {"DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME", "raw_sha256"}

_ROWS = 1 << 16  # read at once


def raw_checksum(file: Any) -> str:
    """SHA-256 (hex) of names, attributes and values."""
    digest = hashlib.sha256()
    _add_attrs(digest, file)
    for name in (*RAW_GROUPS, "protocol_toml"):
        if name in file:
            _add(digest, file[name])
    return digest.hexdigest()


def _add(digest: Any, item: Any) -> None:
    digest.update(item.name.encode() + b"\0")
    _add_attrs(digest, item)
    if isinstance(item, h5py.Dataset):
        digest.update(item.dtype.str.encode() + repr(item.shape).encode())
        for rows in [slice(k, k + _ROWS) for k in range(0, len(item), _ROWS)] if item.ndim == 1 else [()]:
            digest.update(item[rows].tobytes())
    else:
        for name in sorted(item):
            _add(digest, item[name])


def _add_attrs(digest: Any, item: Any) -> None:
    plot = ATTRIBUTES if "NX_class" in item.attrs else ()
    for key in sorted(set(item.attrs) - _NOT_MEASURED - set(plot)):
        value = item.attrs[key]
        text = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
        digest.update(f"{key}={text!s}\0".encode())
