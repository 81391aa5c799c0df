"""Find: where the residuals are not noise, with one false-alarm rate for everything looked at together."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from draglag.gap.fit import Fit
from draglag.gap.signatures import SIGNATURES, jumps, shape_free
from draglag.recording import FloatArray
from draglag.simulation.residual import LineGains, Signature

LEVEL = 0.01
DRAWS = 200
SEED = 20260101  # the calibration is a computation, not an experiment: the same session gives the same verdict


@dataclass(frozen=True)
class Candidate:
    """One thing looked at: a library effect at its best setting, or a smooth term in a covariate.

    gain: twice the log-likelihood it adds. n_columns, n_grid: what that cost. p_value: after all looks together.
    """

    effect: str | None
    covariate: str
    role: str
    gain: float
    n_columns: int
    n_grid: int
    p_value: float
    theta: tuple[float, ...] = ()

    @property
    def score(self) -> float:
        """Gain less its price: six a column and two ln of the grid's size."""
        return float(self.gain - 6 * self.n_columns - 2 * np.log(self.n_grid))


@dataclass(frozen=True)
class Finding:
    """All candidates, best score first; ``significant`` are those beyond the joint level."""

    candidates: tuple[Candidate, ...]
    p_value: float

    @property
    def significant(self) -> tuple[Candidate, ...]:
        return tuple(c for c in self.candidates if c.p_value <= LEVEL)


def find(fit: Fit, without: Collection[str] = (), only: Collection[str] | None = None) -> Finding:
    """Test every library effect and every smooth term against the fit. ``without`` leaves library effects out."""
    items: list[tuple[str | None, str, str, Signature | None, FloatArray]] = []
    gains_of_lines = _line_gains(fit)
    for effect, make in SIGNATURES.items():
        if effect in without or (only is not None and effect not in only):
            continue
        for signature in make(fit.view, gains_of_lines):
            items.append((effect, "", "", signature, signature.columns(fit.view)))
    for (covariate, role), columns in shape_free(fit.view).items():
        items.append((None, covariate, role, None, columns))
    items += [(None, "x", role, made, made.columns(fit.view)) for role, made in jumps(fit.view)]
    gains, null = _gains(fit, [columns for *_, columns in items])
    ranks = np.array([columns.shape[1] for *_, columns in items])
    logs = np.array([chi2.logsf(np.maximum(g, 1e-9), k) for g, k in zip(gains, ranks, strict=True)])
    null_logs = chi2.logsf(np.maximum(null, 1e-9), ranks[:, None])
    worst = np.sort(-null_logs.min(axis=0))
    p_values = np.array([_joint_p(-value, worst) for value in logs])
    out: dict[tuple[str | None, str, str], Candidate] = {}
    for item, gain, p in zip(items, gains, p_values, strict=True):
        name, covariate, role, made, columns = item
        candidate = Candidate(
            name,
            covariate,
            role,
            float(gain),
            columns.shape[1],
            made.n_grid if made else 1,
            float(min(p * made.looks, 1.0)) if made else float(p),
            made.theta if made else (),
        )
        key = (name, covariate, role)
        if key not in out or candidate.score > out[key].score:
            out[key] = candidate
    ranked = tuple(sorted(out.values(), key=lambda c: -c.score))
    return Finding(ranked, min((c.p_value for c in ranked), default=1.0))


def _line_gains(fit: Fit) -> LineGains:
    """Of columns (m, 2 k), how much each pair gains on the white residual, (k,)."""
    white = fit.whiteners[fit.best]
    design = np.vstack([white.apply(fit.design), np.diag(np.sqrt(fit.prior))])
    q, _ = np.linalg.qr(design)
    own = q[: fit.residual_mm.size]
    left = white.apply(fit.residual_mm)
    left = left - own @ (own.T @ left)

    def gains(columns: FloatArray) -> FloatArray:
        moment = (white.apply(columns).T @ left).reshape(-1, 2)
        size = np.sum(white.apply(columns) ** 2, axis=0).reshape(-1, 2)
        return np.asarray(np.sum(moment**2 / np.maximum(size, 1e-12), axis=1), float)

    return gains


def _joint_p(value: float, worst: FloatArray) -> float:
    """Share of sessions without any effect in which the most striking candidate is at least this striking.

    Beyond the draws the tail of −ln p is exponential, as it is for any maximum of such statistics.
    """
    n = worst.size
    above = int(np.count_nonzero(worst >= value))
    if above >= 5:
        return above / n
    corner = worst[int(0.9 * n)]
    scale = max(float(np.mean(worst[worst > corner] - corner)), 0.5)
    return float(min(0.1 * np.exp(-(value - corner) / scale), 1.0))


def _gains(fit: Fit, columns: list[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Twice the log-likelihood gained by each candidate: observed (c,), and in draws of pure noise (c, DRAWS).

    The scatter between runs is chosen anew with and without the candidate: under the null alone it would take up what
    a candidate between runs explains.
    """
    rng = np.random.default_rng(SEED)
    m = fit.residual_mm.size
    best = fit.whiteners[fit.best]
    noise = best.colour(rng.standard_normal((m, DRAWS)))
    data = np.column_stack([fit.residual_mm, noise])
    stacked = np.column_stack(columns)
    ends = np.cumsum([c.shape[1] for c in columns])
    base_value = np.full(DRAWS + 1, -np.inf)
    values = np.full((len(columns), DRAWS + 1), -np.inf)
    root = np.sqrt(fit.prior)
    for white in fit.whiteners:
        design = np.vstack([white.apply(fit.design), np.diag(root)])
        pad = np.zeros((root.size, 1))
        q, _ = np.linalg.qr(design)
        b = np.vstack([white.apply(data), np.broadcast_to(pad, (root.size, DRAWS + 1))])
        b -= q @ (q.T @ b)
        x = np.vstack([white.apply(stacked), np.broadcast_to(pad, (root.size, stacked.shape[1]))])
        whole = np.sum(x * x, axis=0)
        x -= q @ (q.T @ x)
        # What the model all but holds already cannot be tested; rounding would be taken for evidence.
        x[:, np.sum(x * x, axis=0) < 3e-3 * whole] = 0.0
        rest = -0.5 * np.sum(b * b, axis=0) - 0.5 * white.log_det
        base_value = np.maximum(base_value, rest)
        moment = x.T @ b
        start = 0
        for k, end in enumerate(ends):
            own = x[:, start:end]
            gram = own.T @ own
            scale = np.sqrt(np.maximum(np.diag(gram), 1e-12))
            inverse = np.linalg.pinv(gram / np.outer(scale, scale), rcond=1e-4, hermitian=True)
            part = moment[start:end] / scale[:, None]
            gained = 0.5 * np.einsum("kd,kl,ld->d", part, inverse, part)
            values[k] = np.maximum(values[k], rest + gained)
            start = end
    gain = 2 * (values - base_value)
    return gain[:, 0], gain[:, 1:]
