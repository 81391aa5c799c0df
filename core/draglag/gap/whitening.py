"""White residuals: the covariance of all edges, banded within a run, and what is common to a whole run of low rank.

C = B + U Uᵀ with B banded and U three columns of each run. With B = L Lᵀ and Ũ = L⁻¹ U, the Cholesky factor of C is
L M, M that of I + Ũ Ũᵀ, whose row i is what recursive least squares expects of x_i after the edges before it (any
textbook on linear filtering). So time and memory grow with the number of edges, not with its square and cube.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dpbtrf, dtbtrs

from draglag.gap.noise import Components, Scatter
from draglag.recording import FloatArray, IntArray


@dataclass(frozen=True)
class Whitener:
    """Cholesky factor of one grid point: ``apply`` makes residuals (m,) or (m, k) white; ``log_det`` is ln |C|.

    Attributes:
        variance_mm2: (m,) diagonal of C. banded: (b, m) factor L. common: (m, 3) columns Ũ. lead: (m, 3) the row of Ũ
            times the inverse of I + Ũᵀ Ũ over the run's earlier edges. step: (m,) diagonal of M. begin: (m,) first edge
            of the own run.
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
        """Whiten (m,) or (m, k)."""
        columns = values.reshape(values.shape[0], -1)
        if not columns.size:
            return np.zeros(values.shape)
        x = dtbtrs(self.banded, np.asfortranarray(columns), uplo="L")[0]
        white = self._less_common(x, self.common, self.lead, -1) / self.step[:, None]
        return np.asarray(white, np.float64).reshape(values.shape)

    def colour(self, white: FloatArray) -> FloatArray:
        """Residuals (m, k) of this covariance from white ones: the inverse of ``apply``."""
        x = self._less_common(white * self.step[:, None], self.lead / self.step[:, None] ** 2, self.common, 1)
        out = np.zeros_like(x)
        for j, band in enumerate(self.banded):
            out[j:] += band[: x.shape[0] - j, None] * x[: x.shape[0] - j]
        return out

    def _less_common(self, x: FloatArray, seen: FloatArray, shown: FloatArray, sign: int) -> FloatArray:
        """x ± Σ_r shown_r · (sum of seen_r · x over the run's earlier edges), x (m, k)."""
        out = x.copy(order="F")
        total = np.zeros((x.shape[1], x.shape[0] + 1))
        for r in np.flatnonzero(shown.any(axis=0)):
            np.cumsum(x.T * seen[:, r], axis=1, out=total[:, 1:])
            sums = total[:, :-1] - total.take(self.begin, axis=1, mode="clip")
            sums *= sign * shown[:, r]
            out += sums.T
        return out


def whitener(parts: Scatter, components: Components) -> Whitener:
    """Factor C = touch + τ² I + speed error + uneven following + run latency + run offset.

    Raises numpy.linalg.LinAlgError when it is not positive definite.
    """
    banded = parts.fixed_mm2 + components.speed**2 * parts.speed_mm2
    banded += components.tremor_mm_s**2 * parts.tremor_s2
    banded[0] += components.edge_mm**2
    common = np.column_stack(
        [
            np.hypot(components.run_s, parts.loose_s)[parts.run] * parts.late_mm_s,
            np.full(parts.run.size, components.run_mm),
            components.uneven * parts.uneven_mm,
        ]
    )
    variance = banded[0] + np.sum(common**2, axis=1)
    if not parts.run.size:
        return Whitener(components, variance, banded, common, common, variance, np.zeros(0, np.int64), 0.0)
    factor, failed = dpbtrf(np.asfortranarray(banded), lower=1, overwrite_ab=1)
    if failed:
        raise np.linalg.LinAlgError(f"edge {failed - 1}: the scatter's covariance is not positive definite")
    common = dtbtrs(factor, np.asfortranarray(common), uplo="L")[0]
    begin = np.searchsorted(parts.run, parts.run, side="left").astype(np.int64)
    outer = np.cumsum(common[:, :, None] * common[:, None, :], axis=0)
    known = np.eye(3) + np.concatenate([np.zeros((1, 3, 3)), outer[:-1]])
    known -= np.where(begin[:, None, None] > 0, outer[begin - 1], 0.0)
    lead = np.linalg.solve(known, common[:, :, None])[:, :, 0]
    step = np.sqrt(1 + np.einsum("mr,mr->m", common, lead))
    log_det = 2 * float(np.sum(np.log(factor[0])) + np.sum(np.log(step)))
    return Whitener(components, variance, factor, common, lead, step, begin, log_det)
