"""Savitzky–Golay filters (1964), quicker to import than scipy.signal."""

from __future__ import annotations

from functools import lru_cache
from math import factorial

import numpy as np

from draglag.recording import FloatArray


def smoothed(values: FloatArray, window: int, degree: int, order: int = 0, step: float = 1.0) -> FloatArray:
    """Values (n,) or (n, k) on an even grid smoothed along the first axis, or their derivative."""
    reach = window // 2
    fit = _fit(window, degree)  # (degree + 1, window): coefficients of the local polynomial, in units of samples
    scale = factorial(order) / step**order
    columns = values.reshape(values.shape[0], -1)
    out = np.empty(columns.shape)
    for k, column in enumerate(columns.T):
        out[reach : column.size - reach, k] = np.convolve(column, scale * fit[order][::-1], "valid")
    at = np.arange(-reach, reach + 1.0)
    powers = np.arange(degree + 1)
    derivative = at[:, None] ** np.maximum(powers - order, 0)
    derivative *= [factorial(p) / factorial(p - order) if p >= order else 0.0 for p in powers]
    ends = derivative @ fit / step**order  # (window, window): the derivative at every sample of a window
    out[:reach] = ends[:reach] @ columns[:window]
    out[columns.shape[0] - reach :] = ends[reach + 1 :] @ columns[columns.shape[0] - window :]
    return out.reshape(values.shape)


def weights(window: int, degree: int) -> FloatArray:
    """Weight of each sample in the smoothed middle of a window, (window,)."""
    return np.array(_fit(window, degree)[0])


@lru_cache(maxsize=32)
def _fit(window: int, degree: int) -> FloatArray:
    at = np.arange(-(window // 2), window // 2 + 1.0)
    # Scaled to ±1, where powers are distinct; back to samples afterwards.
    reach = max(float(at[-1]), 1.0)
    scaled = np.linalg.pinv(np.vander(at / reach, degree + 1, increasing=True))
    return np.asarray(scaled / (reach ** np.arange(degree + 1))[:, None])
