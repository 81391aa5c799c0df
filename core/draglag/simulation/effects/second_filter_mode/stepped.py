"""A step in the law from the runs' latencies; Eq. 5 bends until it nearly hides one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from draglag.gap.fitting.model import LawParameters
from draglag.gap.traces.run_data import RunData
from draglag.recording import FloatArray
from draglag.simulation.effects.second_filter_mode import RUNS_DIFFER_S

RATES_S_MM = np.geomspace(8e-4, 0.06, 24)
# χ² that a step has to gain, and to leave less than any run left out does. Judgement: twice what its name (ln 50) and
# the choice among a dozen thresholds cost in nats.
LEAST_GAIN = 12.0


@dataclass(frozen=True)
class Step:
    """Eq. 5 plus ``size_s`` above a threshold between two runs' speeds; gain in χ².

    alone: whether it explains more than it leaves, and no single run that is off explains as much.
    """

    law: LawParameters
    between_mm_s: tuple[float, float]
    size_s: float
    gain: float
    alone: bool = False

    def thresholds_mm_s(self, count: int = 13) -> FloatArray:
        """Candidate thresholds, between the runs."""
        return np.geomspace(*self.between_mm_s, count + 2)[1:-1]


def find_step(runs: tuple[RunData, ...], less_s: FloatArray | None = None) -> Step | None:
    """Best step through the runs' latencies, if any. less_s: (runs,) what other effects add."""
    rows = [
        (d.estimate.speed_mm_s, d.estimate.latency_s - (0.0 if less_s is None else less_s[k]), d.estimate.curve_se_s)
        for k, d in enumerate(runs)
        if d.estimate is not None and d.estimate.latency_s is not None and d.estimate.speed_mm_s is not None
        and d.estimate.curve_se_s
    ]  # fmt: skip
    if len(rows) < 8:
        return None
    v, latency, se = np.array(sorted(rows), float).T
    weight = 1 / np.hypot(se, RUNS_DIFFER_S)
    slow, fast = np.triu_indices(RATES_S_MM.size, 1)
    rates = np.column_stack([RATES_S_MM[slow], RATES_S_MM[fast]])
    base = np.stack([*(np.exp(-rates[:, [k]] * v) for k in (0, 1)), np.ones((rates.shape[0], v.size))], axis=2)
    plain, _ = _solve(base, latency, weight)
    best, left_over = None, np.inf
    for left, right in pairwise(v[1:-1]):
        threshold = float(np.sqrt(left * right))
        step = np.broadcast_to((v > threshold).astype(float)[None, :, None], (rates.shape[0], v.size, 1))
        chi2, solution = _solve(np.concatenate([base, step], axis=2), latency, weight)
        k = int(np.argmin(chi2))
        if not np.isfinite(chi2[k]):
            continue
        gain = float(plain.min() - chi2[k])  # infinite where no Eq. 5 without a step falls
        if gain > LEAST_GAIN and chi2[k] < left_over:
            left_over = float(chi2[k])
            a1, a4, a7, size = (float(q) for q in solution[k])
            law = LawParameters(max(a1, 1e-3), float(rates[k, 0]), max(a4, 1e-3), float(rates[k, 1]), a7)
            best = Step(law, (float(left), float(right)), size, gain)
    if best is None or best.gain < left_over:
        return best
    rival = min(
        _solve(np.delete(base, j, 1), np.delete(latency, j), np.delete(weight, j))[0].min() for j in range(v.size)
    )
    return replace(best, alone=bool(rival > left_over + LEAST_GAIN))


def _solve(columns: FloatArray, latency: FloatArray, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
    """χ² (g,), infinite for negative amplitudes of Eq. 5; amplitudes (g, p)."""
    a = columns * weight[None, :, None]
    b = latency * weight
    normal = np.swapaxes(a, 1, 2) @ a
    normal += 1e-9 * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(a.shape[2])
    solution = np.linalg.solve(normal, (np.swapaxes(a, 1, 2) @ b)[..., None])[..., 0]
    chi2 = np.sum((b - np.einsum("gnp,gp->gn", a, solution)) ** 2, axis=1)
    possible = (solution[:, 0] >= 0) & (solution[:, 1] >= 0)
    return np.where(possible, chi2, np.inf), np.asarray(solution, float)
