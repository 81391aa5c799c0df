"""Whitening by bands and low rank against the covariance written out."""

import numpy as np
import pytest

from draglag.gap.constants import MEMORY_S
from draglag.gap.fitting.noise import Components, Scatter
from draglag.gap.fitting.whitening import inner_products, whitener

M, REACH = 60, 5


@pytest.fixture
def parts() -> Scatter:
    rng = np.random.default_rng(1)
    run = np.sort(rng.integers(0, 4, M))
    same = np.array([[i + j < M and run[min(i + j, M - 1)] == run[i] for i in range(M)] for j in range(REACH)])
    # Diagonally dominant, so that it is a covariance.
    fixed, slow, speed, tremor = (np.where(same, rng.uniform(-0.1, 0.1, (REACH, M)), 0.0) for _ in range(4))
    fixed[0], slow[0], speed[0], tremor[0] = (rng.uniform(1, 2, M) for _ in range(4))
    late, uneven, loose = rng.normal(0, 300, M), rng.normal(0, 2, M), np.array([0.0, 2e-3, 0.0, 1e-3])
    return Scatter(fixed, slow, speed, tremor, late, uneven, run, loose, np.cumsum(rng.uniform(0.02, 0.2, M)))


def _dense(parts: Scatter, components: Components) -> np.ndarray:
    c = np.zeros((M, M))
    for i in range(M):
        for j in range(min(REACH, M - i)):
            shared = components.speed**2 * parts.speed_mm2[j, i] + components.tremor_mm_s**2 * parts.tremor_s2[j, i]
            shared += components.slow_mm**2 * parts.slow[j, i]
            c[i + j, i] = c[i, i + j] = parts.fixed_mm2[j, i] + shared
    c += np.diag((components.late_s * parts.late_mm_s) ** 2)
    apart_s = np.abs(np.subtract.outer(parts.t_s, parts.t_s))
    wander = np.outer(parts.late_mm_s, parts.late_mm_s) * np.exp(-apart_s / MEMORY_S)
    c += np.where(parts.run[:, None] == parts.run, components.wander_s**2 * wander, 0.0)
    late = np.hypot(components.run_s, parts.loose_s[parts.run]) * parts.late_mm_s
    own = components.uneven * parts.uneven_mm
    common = np.outer(late, late) + components.run_mm**2 + np.outer(own, own)
    return c + np.where(parts.run[:, None] == parts.run, common, 0.0)


@pytest.mark.parametrize(
    "components",
    [Components(0.1, 0.02, 3.0, 0.3, 5e-4, 0.05, 3e-4, 7e-4), Components(*[0.0] * 6)],
    ids=["all", "least"],
)
def test_white_residuals_are_those_of_the_covariance_written_out(parts: Scatter, components: Components) -> None:
    residual = np.random.default_rng(2).standard_normal((M, 3))
    white, factor = whitener(parts, components), np.linalg.cholesky(_dense(parts, components))
    assert white.apply(residual) == pytest.approx(np.linalg.solve(factor, residual), abs=1e-10)
    assert white.apply(residual[:, 0]) == pytest.approx(np.linalg.solve(factor, residual[:, 0]), abs=1e-10)
    assert white.colour(residual) == pytest.approx(factor @ residual, abs=1e-10)
    assert white.log_det == pytest.approx(2 * np.log(np.diag(factor)).sum(), abs=1e-10)
    assert white.variance_mm2 == pytest.approx(np.diag(_dense(parts, components)))


@pytest.mark.parametrize(
    "components", [Components(0.1, 0.02, 3.0, 0.3, 5e-4, 0.05), Components(late_s=3e-4, wander_s=7e-4)]
)
def test_inner_products_are_those_of_white_columns(parts: Scatter, components: Components) -> None:
    columns = np.random.default_rng(3).standard_normal((M, 4))
    products, log_det = inner_products(parts, columns)(components)
    white = np.linalg.solve(np.linalg.cholesky(_dense(parts, components)), columns)
    assert products == pytest.approx(white.T @ white, rel=1e-6)
    assert log_det == pytest.approx(np.linalg.slogdet(_dense(parts, components))[1], abs=1e-6)


def test_what_is_no_covariance_is_refused(parts: Scatter) -> None:
    parts.fixed_mm2[0, 3] = -10.0
    with pytest.raises(np.linalg.LinAlgError):
        whitener(parts, Components(*[0.0] * 6))
