"""Columns read on demand, for exports of any size."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from draglag.store.safely import read_columns, readable_columns
from draglag.store.schema import Table

BLOCK_ROWS = 1 << 16
"""Rows read, or turned into text, at once: 0.5 MB of numbers, some 10 MB as Python's."""


class StoredColumn:
    """A numeric column of an open file, for length, slices and ``np.asarray``; not kept in memory."""

    ndim = 1

    def __init__(self, dataset: Any, dtype: str) -> None:
        self._dataset = dataset
        self.dtype = np.dtype(dtype)
        self.shape: tuple[int, ...] = dataset.shape
        self.nbytes = self.shape[0] * self.dtype.itemsize

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, rows: slice) -> NDArray[Any]:
        values: NDArray[Any] = self._dataset[rows].astype(self.dtype, copy=False)
        return values

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.asarray(self[:], dtype)


def stored_columns(group: Any, table: Table) -> dict[str, Any]:
    """As ``read_columns``, numbers as ``StoredColumn``."""
    if any(column.kind.startswith("S") for column in table.every()):
        return dict(read_columns(group, table))
    datasets = readable_columns(group, table)
    return {
        column.name: StoredColumn(datasets[column.name], column.dtype)
        if column.name in datasets
        else np.empty(0, column.dtype)
        for column in table.every()
    }


def blocks(length: int) -> Iterator[slice]:
    """Slices of at most ``BLOCK_ROWS`` rows."""
    for start in range(0, length, BLOCK_ROWS):
        yield slice(start, min(start + BLOCK_ROWS, length))
