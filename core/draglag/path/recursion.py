"""First-order recursions, as a bidiagonal linear system."""

from __future__ import annotations

import numpy as np
from scipy.linalg.lapack import dtbtrs

from draglag.recording import FloatArray


def recursion(kept: FloatArray, added: FloatArray) -> FloatArray:
    """u_i = kept_i u_{i−1} + added_i from u_0 = added_0; kept (n,), added (n,) or (n, k)."""
    bands = np.zeros((2, kept.size), order="F")
    bands[1, :-1] = -kept[1:]
    columns = added.reshape(kept.size, -1)
    solved = dtbtrs(bands, np.asfortranarray(columns), uplo="L", diag="U")[0] if columns.size else columns
    return np.asarray(solved, float).reshape(added.shape)


def exponentially_smoothed(values: FloatArray, kept: float) -> FloatArray:
    """u_i = kept u_{i−1} + (1 − kept) values_i from u_0 = values_0; (n,)."""
    added = (1 - kept) * values
    added[:1] = values[:1]
    return recursion(np.full(values.size, kept), added)
