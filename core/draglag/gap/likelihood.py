"""How likely residuals are under a scatter, and which scatter makes them likeliest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from draglag.gap.model import N_NUISANCES, base_prior
from draglag.gap.noise import LOCAL, Components, Scatter
from draglag.gap.state import State
from draglag.gap.whitening import Seen, Whitener, seen
from draglag.recording import FloatArray


def profile(white: Whitener, residual: FloatArray, design: FloatArray, prior: FloatArray) -> tuple[float, FloatArray]:
    """Log likelihood with the linear parameters at their best, and their covariance."""
    a, b = white.apply(design), white.apply(residual)
    spread = np.linalg.pinv(a.T @ a + np.diag(prior), hermitian=True)
    moment = a.T @ b
    value = -0.5 * (float(b @ b) - float(moment @ spread @ moment)) - 0.5 * white.log_det
    return value, np.asarray(spread, float)


def likelihoods(
    parts: Scatter, residual: FloatArray, design: FloatArray, prior: FloatArray
) -> Callable[[Components], float]:
    """The log likelihood of ``profile`` under any scatter of these parts. What is banded in it is factored once: most
    scatters that are compared differ in what is common to a run."""
    both = np.column_stack([design, residual])

    @cache
    def banded(edge_mm: float, speed: float, tremor_mm_s: float) -> tuple[Seen, FloatArray]:
        through = seen(parts, Components(edge_mm, speed, tremor_mm_s, 0.0, 0.0, 0.0), both)
        return through, through.columns.T @ through.columns

    @cache
    def value(components: Components) -> float:
        through, whole = banded(components.edge_mm, components.speed, components.tremor_mm_s)
        common, log_det = through.common(components)
        inner = whole - common.T @ common
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
    """The components of greatest likelihood: one kind after the other, from several starts, for they trade places."""
    value = likelihoods(parts, residual, design, prior)
    ends = []
    for best in starts:
        for _ in range(rounds):
            for grid in LOCAL:
                best = max((replace(best, **sizes) for sizes in grid), key=value)
        ends.append(best)
    return max(ends, key=value)


def cost_without_nuisances(white: Whitener, state: State, use: np.ndarray) -> float:
    """Huber's cost after the best nuisances: a step must not be refused for what they would take up."""
    end = base_prior(state.law).size
    nuisance = slice(end - N_NUISANCES, end)
    a, b = white.apply(state.design[use][:, nuisance]), white.apply(state.residual[use])
    precision: FloatArray = state.prior[nuisance]
    left: FloatArray = b
    for _ in range(2):
        calm = a / np.maximum(1.0, np.abs(left) / 4)[:, None]
        size = np.linalg.solve(calm.T @ a + np.diag(precision), calm.T @ b)
        left = np.asarray(b - a @ size, float)
    return _calm_cost(left) + 0.5 * float(size**2 @ precision)


def _calm_cost(z: FloatArray) -> float:
    """Huber's cost with its corner at 4 standard deviations."""
    size = np.abs(z)
    return float(np.sum(np.where(size < 4, 0.5 * size**2, 4 * size - 8)))
