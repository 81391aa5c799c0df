"""Noise of a linearised session."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dpotrf, dtrtrs

from draglag.gap import constants
from draglag.gap.fitting.noise import Scatter
from draglag.gap.posterior.levels import Levels
from draglag.recording import FloatArray, IntArray


@dataclass(frozen=True)
class RunNoise:
    """Parts of a run's covariance, (n, n) or (n,), per unit.

    common: (n, 3) latency, offset, uneven following. loose_s: misfit allowed to changing speed.
    """

    edges: IntArray
    fixed: FloatArray
    speed: FloatArray
    tremor: FloatArray
    common: FloatArray
    loose_s: float
    late: FloatArray
    wander: FloatArray

    def factor(self, levels: Levels) -> FloatArray:
        """Lower Cholesky factor. Raises numpy.linalg.LinAlgError if the covariance is not positive definite."""
        out = self.fixed + levels.speed**2 * self.speed + levels.tremor_mm_s**2 * self.tremor
        if levels.wander_s:
            out += levels.wander_s**2 * self.wander
        common = self.common * np.array([np.hypot(levels.run_s, self.loose_s), levels.run_mm, levels.uneven])
        out += common @ common.T
        own = levels.edge_mm**2 + levels.late_s**2 * self.late + constants.NUGGET_MM2
        out.flat[:: out.shape[0] + 1] += own
        factor, failed = dpotrf(out.T, lower=1, overwrite_a=1)
        if failed:
            raise np.linalg.LinAlgError(f"edge {failed - 1}: the noise's covariance is not positive definite")
        return np.asarray(factor, np.float64)

    def variances_mm2(self, levels: Levels) -> dict[str, FloatArray]:
        """Part ("touch" or of ``Levels``) → variance of each edge, (n,)."""
        latency, offset, uneven = (self.common**2).T
        one = np.ones(self.edges.size)
        unit = {
            "edge_mm": one,
            "speed": np.diag(self.speed),
            "tremor_mm_s": np.diag(self.tremor),
            "uneven": uneven,
            "run_s": latency,
            "run_mm": offset,
            "late_s": self.late,
            "wander_s": np.diag(self.wander),
        }
        return {"touch": np.diag(self.fixed)} | {name: getattr(levels, name) ** 2 * v for name, v in unit.items()}


@dataclass(frozen=True)
class Noise:
    runs: tuple[RunNoise, ...]

    def rms_mm(self, levels: Levels) -> dict[str, float]:
        """RMS of each part."""
        each = [run.variances_mm2(levels) for run in self.runs]
        return {name: float(np.sqrt(np.mean(np.concatenate([one[name] for one in each])))) for name in each[0]}

    def whitened(self, levels: Levels, columns: FloatArray) -> tuple[FloatArray, float]:
        """Whitened columns (m, k), and ln |C|."""
        # Scipy's checks would take longer than a run's own few edges.
        out, log_det = np.empty(columns.shape, order="F"), 0.0
        for run in self.runs:
            factor = run.factor(levels)
            out[run.edges] = dtrtrs(factor, columns[run.edges], lower=1)[0]
            log_det += 2 * float(np.log(factor.diagonal()).sum())
        return out, log_det


def noise_of(parts: Scatter, t_s: FloatArray) -> Noise:
    """Noise of a fit's scatter. t_s: (m,) of edges."""
    return Noise(tuple(_of_run(parts, t_s, int(k)) for k in np.unique(parts.run)))


def _of_run(parts: Scatter, t_s: FloatArray, k: int) -> RunNoise:
    edges = np.flatnonzero(parts.run == k)
    n = edges.size

    def dense(band: FloatArray) -> FloatArray:
        out = np.zeros((n, n))
        row = np.arange(n)
        for j in range(min(band.shape[0], n)):
            at = row[: n - j]
            out[at + j, at] = out[at, at + j] = band[j, edges[: n - j]]
        return out

    lever = parts.late_mm_s[edges]
    apart_s = np.abs(np.subtract.outer(t_s[edges], t_s[edges]))
    return RunNoise(
        edges,
        dense(parts.fixed_mm2),
        dense(parts.speed_mm2),
        dense(parts.tremor_s2),
        np.column_stack([lever, np.ones(n), parts.uneven_mm[edges]]),
        float(parts.loose_s[k]),
        lever**2,
        np.outer(lever, lever) * np.exp(-apart_s / constants.MEMORY_S),
    )
