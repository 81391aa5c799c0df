"""Whitening by a covariance that is banded within a run, plus rank three for the run.

C = B + U Uᵀ, B = L Lᵀ banded. With Ũ = L⁻¹ U, the Cholesky factor of C is L M, M that of I + Ũ Ũᵀ.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
from scipy.linalg.lapack import dpbtrf, dtbtrs

from draglag.gap.fitting.noise import Components, Scatter
from draglag.recording import FloatArray, IntArray


@dataclass(frozen=True)
class Whitener:
    """Cholesky factor of a covariance C.

    variance_mm2: (m,) diagonal of C. banded: (b, m) L. common: (m, 3) Ũ. lead: (m, 3) rows of Ũ times the inverse of I
    + Ũᵀ Ũ over the run's earlier edges. step: (m,) diagonal of M. begin: (m,) the run's first edge.
    """

    components: Components
    variance_mm2: FloatArray
    banded: FloatArray
    common: FloatArray
    lead: FloatArray
    step: FloatArray
    begin: IntArray
    log_det: float

    def apply(self, values: FloatArray) -> FloatArray:
        """White values, (m,) or (m, k)."""
        columns = values.reshape(values.shape[0], -1)
        if not columns.size:
            return np.zeros(values.shape)
        x = dtbtrs(self.banded, np.asfortranarray(columns), uplo="L")[0]
        white = self._without_common(x, self.common, self.lead, -1) / self.step[:, None]
        return np.asarray(white, np.float64).reshape(values.shape)

    def colour(self, white: FloatArray) -> FloatArray:
        """Inverse of ``apply``, (m, k)."""
        x = self._without_common(white * self.step[:, None], self.lead / self.step[:, None] ** 2, self.common, 1)
        out = np.zeros_like(x)
        for j, band in enumerate(self.banded):
            out[j:] += band[: x.shape[0] - j, None] * x[: x.shape[0] - j]
        return out

    def _without_common(self, x: FloatArray, inner: FloatArray, outer: FloatArray, sign: int) -> FloatArray:
        """x ± Σ_r outer_r · (sum of inner_r · x over the run's earlier edges), (m, k)."""
        out = x.copy(order="F")
        total = np.zeros((x.shape[1], x.shape[0] + 1))
        for r in np.flatnonzero(outer.any(axis=0)):
            np.cumsum(x.T * inner[:, r], axis=1, out=total[:, 1:])
            sums = total[:, :-1] - total.take(self.begin, axis=1, mode="clip")
            sums *= sign * outer[:, r]
            out += sums.T
        return out


def whitener(parts: Scatter, components: Components) -> Whitener:
    """Cholesky factor of a scatter. Raises numpy.linalg.LinAlgError if it is not positive definite."""
    banded = _banded(parts, components)
    common = _common(parts) * _sizes(parts, components)[parts.run]
    variance = banded[0] + np.sum(common**2, axis=1)
    if not parts.run.size:
        return Whitener(components, variance, banded, common, common, variance, np.zeros(0, np.int64), 0.0)
    factor = _factor(banded)
    common = dtbtrs(factor, np.asfortranarray(common), uplo="L")[0]
    begin = np.searchsorted(parts.run, parts.run, side="left").astype(np.int64)
    outer = np.cumsum(common[:, :, None] * common[:, None, :], axis=0)
    known = np.eye(3) + np.concatenate([np.zeros((1, 3, 3)), outer[:-1]])
    known -= np.where(begin[:, None, None] > 0, outer[begin - 1], 0.0)
    lead = np.linalg.solve(known, common[:, :, None])[:, :, 0]
    step = np.sqrt(1 + np.einsum("mr,mr->m", common, lead))
    log_det = 2 * float(np.sum(np.log(factor[0])) + np.sum(np.log(step)))
    return Whitener(components, variance, factor, common, lead, step, begin, log_det)


Products = Callable[[Components], tuple[FloatArray, float]]


def inner_products(parts: Scatter, columns: FloatArray) -> Products:
    """Function of the components: inner products xᵀ C⁻¹ y of all columns (m, k), (k, k), and ln |C|.

    Raises numpy.linalg.LinAlgError if C is not positive definite.
    """

    @cache
    def banded(
        slow_mm: float, speed: float, tremor_mm_s: float, late_s: float, wander_s: float
    ) -> tuple[FloatArray, Common]:
        local = Components(slow_mm, speed, tremor_mm_s, 0.0, 0.0, 0.0, late_s, wander_s)
        white, common = whitened_columns(parts, local, columns)
        return white.T @ white, common

    def products(components: Components) -> tuple[FloatArray, float]:
        c = components
        whole, common = banded(c.slow_mm, c.speed, c.tremor_mm_s, c.late_s, c.wander_s)
        rows, log_det = common.rows(components)
        return whole - rows.T @ rows, log_det

    return products


@dataclass(frozen=True)
class Common:
    """What the runs' common parts take from inner products (Woodbury). log_det: ln |B|.

    cross (runs, 3, k), own (runs, 3, 3): products of a run's common part.
    """

    parts: Scatter
    log_det: float
    cross: FloatArray
    own: FloatArray

    def rows(self, components: Components) -> tuple[FloatArray, float]:
        """Rows (3 runs, k) whose inner products are subtracted, and ln |C|."""
        size = _sizes(self.parts, components)[:, :, None]
        root = np.linalg.cholesky(np.eye(3) + size * self.own * np.swapaxes(size, 1, 2))
        rows = np.linalg.solve(root, size * self.cross).reshape(-1, self.cross.shape[2])
        return rows, self.log_det + 2 * float(np.sum(np.log(np.diagonal(root, axis1=1, axis2=2))))


def whitened_columns(parts: Scatter, components: Components, columns: FloatArray) -> tuple[FloatArray, Common]:
    """Columns (m, k) whitened by a scatter's banded part B, and what is still to be subtracted.

    Raises numpy.linalg.LinAlgError if B is not positive definite.
    """
    factor, through = _banded(parts, components), np.column_stack([_common(parts), columns])
    if through.size:
        factor = _factor(factor)
        through = dtbtrs(factor, np.asfortranarray(through), uplo="L")[0]
    inner = np.zeros((parts.loose_s.size, 3, through.shape[1]))
    begins = np.flatnonzero(np.diff(parts.run, prepend=-1))
    for own in (slice(*ends) for ends in pairwise([*begins, parts.run.size])):
        inner[parts.run[own.start]] = through[own, :3].T @ through[own]
    log_det = 2 * float(np.sum(np.log(factor[0])))
    return through[:, 3:], Common(parts, log_det, inner[:, :, 3:], inner[:, :, :3])


def _banded(parts: Scatter, components: Components) -> FloatArray:
    """B (b, m)."""
    banded = parts.fixed_mm2 + components.speed**2 * parts.speed_mm2
    banded += components.tremor_mm_s**2 * parts.tremor_s2
    banded += components.slow_mm**2 * parts.slow
    banded[0] += components.late_s**2 * parts.late_mm_s**2
    if not components.wander_s:
        return np.asarray(banded)
    wander = components.wander_s**2 * parts.wander_mm2_s2
    wander[: banded.shape[0]] += banded
    return np.asarray(wander)


def _factor(banded: FloatArray) -> FloatArray:
    factor, failed = dpbtrf(np.asfortranarray(banded), lower=1, overwrite_ab=1)
    if failed:
        raise np.linalg.LinAlgError(f"edge {failed - 1}: the scatter's covariance is not positive definite")
    return np.asarray(factor)


def _common(parts: Scatter) -> FloatArray:
    """Shift by latency, offset and uneven following of the run, per unit, (m, 3)."""
    return np.column_stack([parts.late_mm_s, np.ones(parts.run.size), parts.uneven_mm])


def _sizes(parts: Scatter, components: Components) -> FloatArray:
    """Standard deviations of those, (runs, 3)."""
    late_s = np.hypot(components.run_s, parts.loose_s)
    return np.column_stack([late_s, *(np.full(late_s.size, q) for q in (components.run_mm, components.uneven))])
