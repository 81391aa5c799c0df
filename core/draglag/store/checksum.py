"""A checksum of what was measured, independent of how HDF5 lays it out."""

from __future__ import annotations

import hashlib
from typing import Any

import h5py

from draglag.store.schema import RAW_GROUPS

_HDF5_OWN = {"DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME"}


def raw_checksum(file: Any) -> str:
    """SHA-256 over names, attributes and values of the raw groups of an open file (hex)."""
    digest = hashlib.sha256()
    for name in RAW_GROUPS:
        if name in file:
            _add(digest, file[name])
    return digest.hexdigest()


def _add(digest: Any, item: Any) -> None:
    digest.update(item.name.encode() + b"\0")
    for key in sorted(set(item.attrs) - _HDF5_OWN):
        value = item.attrs[key]
        text = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
        digest.update(f"{key}={text!s}\0".encode())
    if isinstance(item, h5py.Dataset):
        digest.update(item.dtype.str.encode() + repr(item.shape).encode() + item[()].tobytes())
    else:
        for name in sorted(item):
            _add(digest, item[name])
