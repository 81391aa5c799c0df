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
OF_EQ5 = (
    np.column_stack([RATES_S_MM[k] for k in np.triu_indices(RATES_S_MM.size, 1)]),
    RATES_S_MM[:, None],
    np.empty((1, 0)),
)
"""Rates of two exponentials, of one, and of none: a constant law has neither."""
LEAST_S = 1e-3  # of an amplitude where a search begins. Derived: an amplitude of zero has no rate
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
    plain = _fitted(v, latency, weight).chi2
    best, left_over = None, np.inf
    for left, right in pairwise(v[1:-1]):
        found = _fitted(v, latency, weight, above_mm_s=float(np.sqrt(left * right)))
        gain = plain - found.chi2
        if gain > LEAST_GAIN and found.chi2 < left_over:
            left_over = found.chi2
            best = Step(found.law, (float(left), float(right)), found.size_s, gain)
    if best is None or best.gain < left_over:
        return best
    rival = min(_fitted(np.delete(v, j), np.delete(latency, j), np.delete(weight, j)).chi2 for j in range(v.size))
    return replace(best, alone=bool(rival > left_over + LEAST_GAIN))


@dataclass(frozen=True)
class _Fitted:
    chi2: float
    law: LawParameters
    size_s: float


def _fitted(v_mm_s: FloatArray, latency_s: FloatArray, weight: FloatArray, above_mm_s: float | None = None) -> _Fitted:
    """Best Eq. 5 whose amplitudes are not negative, with a step above a speed."""
    best = None
    for rates in OF_EQ5:
        columns = [np.exp(-rates[:, [k]] * v_mm_s) for k in range(rates.shape[1])]
        columns.append(np.ones((len(rates), v_mm_s.size)))
        if above_mm_s is not None:
            columns.append(np.broadcast_to((v_mm_s > above_mm_s).astype(float), columns[-1].shape))
        chi2, solution = _solve(np.stack(columns, axis=2), latency_s, weight, rates.shape[1])
        k = int(np.argmin(chi2))
        if best is None or chi2[k] < best.chi2:
            best = _Fitted(float(chi2[k]), _law_of(rates[k], solution[k]), float(solution[k, -1]))
    assert best is not None
    return best


def _law_of(rates: FloatArray, solution: FloatArray) -> LawParameters:
    """Where a search of the law may begin: exponentials that are not there are small."""
    missing = 2 - rates.size
    a1, a4 = (max(float(a), LEAST_S) for a in (*solution[: rates.size], *[0.0] * missing))
    a2, a5 = (float(rate) for rate in (*rates, *[RATES_S_MM[0]] * missing))
    return LawParameters(a1, a2, a4, a5, float(solution[rates.size]))


def _solve(
    columns: FloatArray, latency_s: FloatArray, weight: FloatArray, exponentials: int
) -> tuple[FloatArray, FloatArray]:
    """χ² (g,), infinite for negative amplitudes of the exponentials, which come first; amplitudes (g, p)."""
    a = columns * weight[None, :, None]
    b = latency_s * weight
    normal = np.swapaxes(a, 1, 2) @ a
    normal += 1e-9 * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(a.shape[2])
    solution = np.linalg.solve(normal, (np.swapaxes(a, 1, 2) @ b)[..., None])[..., 0]
    chi2 = np.sum((b - np.einsum("gnp,gp->gn", a, solution)) ** 2, axis=1)
    possible = (solution[:, :exponentials] >= 0).all(axis=1)
    return np.where(possible, chi2, np.inf), np.asarray(solution, float)
