"""Find: where the residuals are not noise, with one false-alarm rate for everything looked at together."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.stats import chi2

from draglag.gap.fitting.joint import Fit
from draglag.gap.fitting.noise import Scatter, scatter
from draglag.gap.fitting.signatures import SIGNATURES, jumps, shape_free
from draglag.gap.fitting.whitening import seen
from draglag.recording import FloatArray, IntArray
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
    parts = scatter(fit.runs, fit.placed, fit.use, fit.blur_mm)
    gains_of_lines = line_gains(fit, parts)
    for effect, make in SIGNATURES.items():
        if effect in without or (only is not None and effect not in only):
            continue
        for signature in make(fit.view, gains_of_lines):
            items.append((effect, "", "", signature, signature.columns(fit.view)))
    for (covariate, role), columns in shape_free(fit.view).items():
        items.append((None, covariate, role, None, columns))
    items += [(None, along, role, made, made.columns(fit.view)) for along, role, made in jumps(fit.view)]
    gains, null = _gains(fit, parts, [columns for *_, columns in items])
    ranks = np.array([columns.shape[1] for *_, columns in items])
    logs = chi2.logsf(np.maximum(gains, 1e-9), ranks)
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


def line_gains(fit: Fit, parts: Scatter) -> LineGains:
    """Of columns (m, 2 k), how much each pair gains on the white residual, (k,)."""
    white = fit.whiteners[fit.best]
    design = np.vstack([white.apply(fit.design), np.diag(np.sqrt(fit.prior))])
    target = np.append(white.apply(fit.residual_mm), np.zeros(fit.prior.size))
    left = fit.residual_mm - fit.design @ np.linalg.lstsq(design, target, rcond=None)[0]

    def gains(columns: FloatArray) -> FloatArray:
        through = seen(parts, white.components, np.column_stack([columns, left]))
        x, common = through.columns, through.common(white.components)[0]
        moment = (x.T @ x[:, -1] - common.T @ common[:, -1])[:-1].reshape(-1, 2)
        size = (np.sum(x**2, axis=0) - np.sum(common**2, axis=0))[:-1].reshape(-1, 2)
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


def _gains(fit: Fit, parts: Scatter, columns: list[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Twice the log-likelihood gained by each candidate: observed (c,), and in draws of pure noise (c, DRAWS).

    The scatter between runs is chosen anew with and without the candidate: under the null alone it would take up what
    a candidate between runs explains. A fit's whiteners differ in nothing else: what is banded is undone once.
    """
    rng = np.random.default_rng(SEED)
    best = fit.whiteners[fit.best]
    noise = best.colour(rng.standard_normal((fit.residual_mm.size, DRAWS)))
    model, ridge = _well_conditioned(fit)
    sizes = [model.shape[1], DRAWS + 1, *(c.shape[1] for c in columns)]
    through = seen(parts, best.components, np.column_stack([model, fit.residual_mm, noise, *columns]))
    model, data, x = np.split(through.columns, np.cumsum(sizes[:2]), axis=1)
    inner, model_data, model_x = model.T @ model + ridge, model.T @ data, model.T @ x
    data_whole, x_whole, x_data = np.sum(data * data, axis=0), np.sum(x * x, axis=0), x.T @ data
    alike = _of_one_width(sizes[2:])
    grams = [np.einsum("mci,mcj->cij", x[:, at], x[:, at]) for _, at in alike]
    base_value = np.full(DRAWS + 1, -np.inf)
    values = np.full((len(columns), DRAWS + 1), -np.inf)
    for white in fit.whiteners:
        common, log_det = through.common(white.components)
        of_model, of_data, of_x = np.split(common, np.cumsum(sizes[:2]), axis=1)
        root = np.linalg.cholesky(inner - of_model.T @ of_model)
        # Rows of what runs share and of what the model explains: inner products are the banded ones less theirs.
        of_data = np.vstack([of_data, np.linalg.solve(root, model_data - of_model.T @ of_data)])
        explained = np.linalg.solve(root, model_x - of_model.T @ of_x)
        whole = x_whole - np.sum(of_x * of_x, axis=0)
        # What the model all but holds already cannot be tested; rounding would be taken for evidence.
        told = whole - np.sum(explained * explained, axis=0) >= 3e-3 * whole
        of_x = np.vstack([of_x, explained])
        rest = -0.5 * (data_whole - np.sum(of_data * of_data, axis=0)) - 0.5 * log_det
        base_value = np.maximum(base_value, rest)
        moment = (x_data - of_x.T @ of_data) * told[:, None]
        for (which, at), gram in zip(alike, grams, strict=True):
            taken = of_x[:, at]
            own = (gram - np.einsum("rci,rcj->cij", taken, taken)) * (told[at][:, :, None] & told[at][:, None, :])
            gained = 0.5 * _explained(own, moment[at])
            values[which] = np.maximum(values[which], rest + gained)
    gain = 2 * (values - base_value)
    return gain[:, 0], gain[:, 1:]


def _well_conditioned(fit: Fit) -> tuple[FloatArray, FloatArray]:
    """Columns (m, p) that span what the fit's do and are of unit length and apart when white, and the prior precision
    (p, p) of their sizes."""
    root = np.diag(np.sqrt(fit.prior))
    r = np.linalg.qr(np.vstack([fit.whiteners[fit.best].apply(fit.design), root]), mode="r")
    columns, prior = (np.asarray(solve_triangular(r, rows.T, trans="T")).T for rows in (fit.design, root))
    return columns, prior.T @ prior


def _of_one_width(widths: list[int]) -> list[tuple[IntArray, IntArray]]:
    """Candidates (c,) of each number of columns k, and which columns of all they are, (c, k)."""
    first, wide = np.cumsum([0, *widths])[:-1], np.array(widths)
    groups = [(np.flatnonzero(wide == k), k) for k in np.unique(wide)]
    return [(which, first[which][:, None] + np.arange(k)) for which, k in groups]


def _explained(gram: FloatArray, moment: FloatArray) -> FloatArray:
    """What c candidates' columns explain of d targets, (c, d), by their grams (c, k, k) and moments (c, k, d)."""
    scale = np.sqrt(np.maximum(np.diagonal(gram, axis1=1, axis2=2), 1e-12))
    inverse = np.linalg.pinv(gram / (scale[:, :, None] * scale[:, None, :]), rcond=1e-4, hermitian=True)
    part = moment / scale[:, :, None]
    return np.asarray(np.sum(part * (inverse @ part), axis=1))
