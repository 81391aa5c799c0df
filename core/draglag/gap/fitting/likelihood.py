"""Likelihood of residuals, and its maximum over noise components."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product

import numpy as np

from draglag.gap.fitting.model import LawParameters, nuisances
from draglag.gap.fitting.noise import LOCAL, Components, Scatter
from draglag.gap.fitting.state import State
from draglag.gap.fitting.whitening import Whitener, inner_products
from draglag.recording import FloatArray, IntArray

HUBER_K = 4.0  # standard deviations: Huber's corner, which one edge in 16 000 passes by chance. Derived


def profile(white: Whitener, residual: FloatArray, design: FloatArray, prior: FloatArray) -> tuple[float, FloatArray]:
    """Profile log-likelihood over the linear parameters, and their covariance."""
    a, b = white.apply(design), white.apply(residual)
    spread = np.linalg.pinv(a.T @ a + np.diag(prior), hermitian=True)
    moment = a.T @ b
    value = -0.5 * (float(b @ b) - float(moment @ spread @ moment)) - 0.5 * white.log_det
    return value, np.asarray(spread, float)


def likelihoods(
    parts: Scatter, residual: FloatArray, design: FloatArray, prior: FloatArray
) -> Callable[[Components], float]:
    """Profile log-likelihood as a function of the components."""
    products = inner_products(parts, np.column_stack([design, residual]))

    @cache
    def value(components: Components) -> float:
        inner, log_det = products(components)
        moment = inner[:-1, -1]
        spread = np.linalg.pinv(inner[:-1, :-1] + np.diag(prior), hermitian=True)
        return -0.5 * float(inner[-1, -1] - moment @ spread @ moment) - 0.5 * log_det

    return value


def likeliest(
    parts: Scatter,
    residual: FloatArray,
    design: FloatArray,
    prior: FloatArray,
    starts: Sequence[Components],
    rounds: int = 2,
) -> Components:
    """Components of maximum likelihood, by coordinate search uphill from each start."""
    value = likelihoods(parts, residual, design, prior)
    ends = []
    for best in starts:
        for _ in range(rounds):
            for grid in LOCAL:
                best = _uphill(best, grid, value)
        ends.append(best)
    return max(ends, key=value)


def _uphill(start: Components, grid: Mapping[str, Sequence[float]], value: Callable[[Components], float]) -> Components:
    """Top of a grid that leads uphill from the point nearest to ``start``, from neighbour to neighbour."""

    def there(at: tuple[int, ...]) -> Components:
        return replace(start, **{name: sizes[k] for (name, sizes), k in zip(grid.items(), at, strict=True)})

    at = tuple(int(np.argmin(np.abs(np.array(sizes) - getattr(start, name)))) for name, sizes in grid.items())
    while True:
        around = (range(max(k - 1, 0), min(k + 2, len(sizes))) for sizes, k in zip(grid.values(), at, strict=True))
        best = max(product(*around), key=lambda near: value(there(near)))
        if value(there(best)) <= value(there(at)):
            return there(at)
        at = best


def cost_without_nuisances(white: Whitener, state: State, use: np.ndarray) -> float:
    """Huber's cost at the best nuisances, and the sizes' prior."""
    left, own_cost = _without_nuisances(white, state, use)
    return _huber_cost(left) + own_cost + _prior_cost(state)


@dataclass(frozen=True)
class Downhill:
    """Gauss–Newton model of the cost. curvature (p, p), slope (p,): zero for nuisances. limit (p,): precision of a step
    of law and beam.
    """

    law: LawParameters
    curvature: FloatArray
    slope: FloatArray
    limit: FloatArray
    cost: float

    def step(self, damping: float) -> tuple[FloatArray, float]:
        """A damped step (p,) within the law's limits, and the predicted fall of the cost."""
        damped = self.curvature + np.diag(self.limit + damping * np.diag(self.curvature))
        step = np.asarray(np.linalg.pinv(damped, hermitian=True) @ self.slope)
        least, most = self.law.step_limits
        own = step[: least.size]
        if np.any((own < least) | (own > most)):
            step = _within(damped, self.slope, least, most)
        return step, float(step @ self.slope - 0.5 * step @ self.curvature @ step)


def _within(curvature: FloatArray, slope: FloatArray, least: FloatArray, most: FloatArray) -> FloatArray:
    """Step (p,) of the lowest cost whose first parameters lie within limits (Stark & Parker 1995)."""
    from scipy.optimize import lsq_linear

    scale = 1 / np.sqrt(np.maximum(np.diag(curvature), np.finfo(float).tiny))
    values, axes = np.linalg.eigh(curvature * np.outer(scale, scale))
    known = values > slope.size * np.finfo(float).eps * values[-1]
    root, along = np.sqrt(values[known]), axes[:, known].T
    limits = np.full((2, slope.size), [[-np.inf], [np.inf]])
    limits[:, : least.size] = least, most
    found = lsq_linear(root[:, None] * along, along @ (scale * slope) / root, limits / scale, method="bvls")
    return np.asarray(scale * found.x, float)


def downhill(white: Whitener, state: State, use: np.ndarray) -> Downhill:
    """Model at a point, outliers weighted down."""
    left, own_cost = _without_nuisances(white, state, use)
    sought = white.apply(state.design[use])
    huber = 1 / np.sqrt(np.maximum(1.0, np.abs(left) / HUBER_K))
    whole = sought * huber[:, None]
    normal, moment = whole.T @ whole, whole.T @ (left * huber)
    own = nuisances(state.law)
    given = np.linalg.inv(normal[own, own] + np.diag(state.prior[own])) @ normal[own]
    curvature = normal - normal[:, own] @ given
    curvature[own], curvature[:, own], moment[own] = 0.0, 0.0, 0.0
    # The prior of Eq. 5 and the beam limits their steps; that of a remainder or an effect's size draws it towards none.
    at, sizes = _drawn_to_none(state)
    limit = state.prior.copy()
    limit[at] = 0.0
    curvature[at, at] += state.prior[at]
    moment[at] -= state.prior[at] * sizes
    return Downhill(state.law, curvature, moment, limit, _huber_cost(left) + own_cost + _prior_cost(state))


def _drawn_to_none(state: State) -> tuple[IntArray, FloatArray]:
    """Places and values (k,) of the parameters whose prior is about zero."""
    remainder = state.law.remainder_s
    sizes = [size for term in state.terms for size in term.sizes]
    end_of_law, begin = len(state.law.step_sd), nuisances(state.law).stop
    at = [*range(end_of_law - len(remainder), end_of_law), *range(begin, begin + len(sizes))]
    return np.array(at, np.int64), np.array([*remainder, *sizes], float)


def _prior_cost(state: State) -> float:
    at, sizes = _drawn_to_none(state)
    return 0.5 * float(state.prior[at] @ sizes**2)


def _without_nuisances(white: Whitener, state: State, use: np.ndarray) -> tuple[FloatArray, float]:
    """Whitened residual (m,), and prior cost of the nuisances."""
    own = nuisances(state.law)
    a, b = white.apply(state.design[use][:, own]), white.apply(state.residual[use])
    precision: FloatArray = state.prior[own]
    left: FloatArray = b
    for _ in range(2):
        huber = a / np.maximum(1.0, np.abs(left) / HUBER_K)[:, None]
        size = np.linalg.solve(huber.T @ a + np.diag(precision), huber.T @ b)
        left = np.asarray(b - a @ size, float)
    return left, 0.5 * float(size**2 @ precision)


def _huber_cost(z: FloatArray) -> float:
    size = np.abs(z)
    return float(np.sum(np.where(size < HUBER_K, 0.5 * size**2, HUBER_K * size - 0.5 * HUBER_K**2)))
