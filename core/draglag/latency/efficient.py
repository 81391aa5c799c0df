"""Joint maximum likelihood over a run: local trajectory, one slope, both lines, every edge by its own variance.

Around a latency L the touch trace says where the stylus was at each edge: a local cubic whose bandwidth is matched to
the motion. The residual of edge i across the beam, y_i − slope · x_i − middle − side_i · half width, is linear in the
line's coefficients and, by the velocity there, in a change of L; so Gauss–Newton on a handful of parameters converges
in three or four steps. Its covariance is known up to two numbers: events share touch noise where windows overlap, and
whatever else scatters single edges (τ²) is estimated so that the weighted residuals are as large as they should be.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.stats import t as student

from draglag.beam import Lines, sides, stylus_diameter_mm
from draglag.latency.common import common_flags, cost_without_shift
from draglag.latency.edges import Edges
from draglag.latency.estimate import FEWEST_EDGES, Alignment, Prepared, RunEstimate
from draglag.latency.scan import Scan, scan
from draglag.motion import LocalFit, best_half_width_s, contact_losses, in_contact, local_fit
from draglag.recording import FloatArray

SPEED_SLOPE_SD_S = 0.08  # prior on dL/d(ln v): spans every published curve; keeps uneven speed from biasing L
ALIAS_LOG_LIKELIHOOD = 4.0  # a rival minimum closer than this cannot be ruled out
SCATTER_LASTS_S = 0.03
WIDER = (1.0, 1.3, 1.7, 2.2, 2.8, 3.6)  # bandwidths tried beyond the one that predicts events best
GRAZING = 0.15  # below this fraction of the speed across the beam, the side of an edge is a guess


@dataclass(frozen=True)
class Solution:
    """A converged fit. parameters: L (s), slope, middle (mm), half width (mm), dL/dln v (s)."""

    latency_s: float
    se_s: float
    parameters: FloatArray
    covariance: FloatArray
    edges: Edges
    fit: LocalFit
    side: FloatArray
    residual_mm: FloatArray
    log_likelihood: float
    dof: int
    tau_mm: float
    noise_mm: float
    n_outside: int
    narrow_s: float = 0.0


def estimate_efficient(ready: Prepared, blank: RunEstimate, window_s: tuple[float, float]) -> RunEstimate:
    """The latency of a run by joint maximum likelihood, with its interval and verdict."""
    coarse = scan(ready.touch, ready.edges, window_s, 6 * ready.dt_s, stylus_diameter_mm=ready.stylus_diameter_mm)
    minima = coarse.minima()
    if not minima:
        return replace(blank, flags=("unidentifiable",))
    guess_s = float(coarse.latency_s[minima[0]])
    half_s, noise_mm = best_half_width_s(ready.touch.t_s, ready.xy_mm[:, 1:], ready.edges.t_s + guess_s)
    if not np.isfinite(noise_mm):
        return replace(blank, flags=("unidentifiable",))
    narrow_s = half_s
    if (rough := solve(ready, guess_s, half_s, noise_mm)) is not None:
        half_s = _bandwidth_for_edges(ready, rough, half_s)
    starts = {} if rough is None else {minima[0]: rough.latency_s}
    solutions = [
        solution
        for k in _worth_refining(coarse, minima)
        if (solution := solve(ready, starts.get(k, float(coarse.latency_s[k])), half_s, noise_mm)) is not None
    ]
    if not solutions:
        return replace(blank, flags=("unidentifiable",))
    solutions.sort(key=lambda s: -s.log_likelihood / max(s.edges.t_s.size, 1))
    best = replace(solutions[0], narrow_s=narrow_s)
    extra = []
    if any(
        best.log_likelihood - rival.log_likelihood < ALIAS_LOG_LIKELIHOOD
        and abs(rival.latency_s - best.latency_s) > 0.01
        for rival in solutions[1:]
    ):
        extra += ["alias", "unidentifiable"]
    if best.n_outside > 0.1 * (best.n_outside + best.edges.t_s.size):
        extra.append("lost_contact")
    if best.tau_mm > 3 * noise_mm:
        extra.append("excess_scatter")
    return common_flags(_describe(ready, blank, best), ready, best.edges, window_s, tuple(extra))


def _worth_refining(coarse: Scan, minima: list[int]) -> list[int]:
    """Minima whose robust cost is within a factor of the best: aliases of the circle's period among them."""
    best = coarse.cost_mm2[minima[0]]
    return [k for k in minima if coarse.cost_mm2[k] <= 6 * best + 0.05]


def _bandwidth_for_edges(ready: Prepared, rough: Solution, half_s: float) -> float:
    """The bandwidth that puts the edges nearest to their lines, from ``half_s`` upwards.

    Predicting left-out events favours narrow windows where the events' noise is correlated: it predicts the noise too.
    The laser does not share that noise, so the scatter of the edges about their lines is the honest judge.
    """
    best_s, least = half_s, np.inf
    for factor in WIDER:
        fit = local_fit(ready.touch.t_s, ready.xy_mm, rough.edges.t_s + rough.latency_s, factor * half_s)
        if np.count_nonzero(fit.ok) < rough.edges.t_s.size:
            break
        across = fit.v_mm_s[:, 1] - rough.parameters[1] * fit.v_mm_s[:, 0]
        design, response = _linearise(fit, rough.side, across)
        _, residuals, *_ = np.linalg.lstsq(design, response, rcond=None)
        scatter = float(residuals[0]) if residuals.size else np.inf
        if scatter < least:
            best_s, least = factor * half_s, scatter
        elif scatter > 1.5 * least:
            break
    return best_s


def solve(ready: Prepared, latency_s: float, half_s: float, noise_mm: float) -> Solution | None:
    """Gauss–Newton from a starting latency; None where too few edges can be placed or it wanders off."""
    touch = ready.touch
    losses = contact_losses(touch.t_s)
    placed = in_contact(touch.t_s, ready.edges.t_s + latency_s, losses)
    edges = Edges(ready.edges.t_s[placed], ready.edges.falling[placed], ready.edges.n_rejected)
    n_outside = int(np.count_nonzero(~placed))
    start_s, slope = latency_s, 0.0
    state: tuple[FloatArray, FloatArray, FloatArray, float] | None = None
    for step in range(8):
        fit = local_fit(touch.t_s, ready.xy_mm, edges.t_s + latency_s, half_s)
        across = fit.v_mm_s[:, 1] - slope * fit.v_mm_s[:, 0]
        keep = fit.ok & (np.abs(across) > GRAZING * fit.speed_mm_s) & (fit.gain < 2)
        if not keep.all():
            # An edge that cannot be placed is dropped; one that no stylus made is rejected further down.
            n_outside += int(np.count_nonzero(~keep))
            edges = Edges(edges.t_s[keep], edges.falling[keep], edges.n_rejected)
            if edges.t_s.size < FEWEST_EDGES:
                return None
            continue
        if edges.t_s.size < FEWEST_EDGES:
            return None
        side = sides(edges.falling, across)
        design, response = _linearise(fit, side, across)
        covariance = noise_mm**2 * _overlap(fit)
        extra = _extra_scatter(edges.t_s)
        # The extra scatter hardly moves between steps: it is sought at the start and whenever edges have gone.
        known = state[3] if state is not None and state[2].size == side.size and step > 1 else None
        estimate, spread, residual, tau = _weighted_fit(design, response, covariance, extra, known)
        slope = float(estimate[1])
        state = (estimate, spread, residual, tau)
        latency_s += float(np.clip(estimate[0], -0.03, 0.03))
        if abs(latency_s - start_s) > 0.06:
            return None
        outlier = _outliers(residual, covariance)
        if step >= 1 and outlier.any() and edges.t_s.size - np.count_nonzero(outlier) >= FEWEST_EDGES:
            edges = edges.take(~outlier)
            continue
        if abs(estimate[0]) < 2e-6 and step >= 2:
            break
    if state is None or state[2].size != edges.t_s.size:
        return None
    estimate, spread, residual, tau = state
    n = residual.size
    total = covariance + tau**2 * _extra_scatter(edges.t_s) + 1e-9 * np.eye(n)
    factor = cho_factor(total)
    log_likelihood = -0.5 * float(residual @ cho_solve(factor, residual)) - float(np.sum(np.log(np.diag(factor[0]))))
    parameters = estimate.copy()
    parameters[0] = latency_s
    return Solution(
        latency_s,
        float(np.sqrt(spread[0, 0])),
        parameters,
        spread,
        edges,
        fit,
        side,
        residual,
        log_likelihood,
        n - 4,
        tau,
        noise_mm,
        n_outside,
    )


def _linearise(fit: LocalFit, side: FloatArray, across: FloatArray) -> tuple[FloatArray, FloatArray]:
    """y = slope · x + middle + side · half − across · δL, columns δL, slope, middle, half, dL/dln v."""
    speed = np.maximum(fit.speed_mm_s, 1e-3)
    relative = np.log(speed)
    relative = np.clip(relative - relative.mean(), -1, 1)
    x, y = fit.xy_mm[:, 0], fit.xy_mm[:, 1]
    return np.column_stack([-across, x, np.ones_like(x), side, -across * relative]), y


def _overlap(fit: LocalFit) -> FloatArray:
    """Covariance of fitted positions in units of one event's variance, (m, m): windows that share events."""
    m, w = fit.weights.shape
    shift = fit.first[None, :] - fit.first[:, None]
    out = np.zeros((m, m))
    near_i, near_j = np.nonzero((np.abs(shift) < w) & (np.arange(m)[:, None] <= np.arange(m)[None, :]))
    offset = shift[near_i, near_j]
    column = np.arange(w)[None, :] + offset[:, None]
    inside = (column >= 0) & (column < w)
    left = np.where(inside, np.take_along_axis(fit.weights[near_i], np.clip(column, 0, w - 1), axis=1), 0.0)
    value = np.einsum("kw,kw->k", left, fit.weights[near_j])
    out[near_i, near_j] = value
    out[near_j, near_i] = value
    out[np.diag_indices(m)] = fit.gain
    return out


def _extra_scatter(edge_t_s: FloatArray) -> FloatArray:
    """Correlation of what scatters edges beyond white touch noise, (m, m).

    Noise that the digitiser's own filter left correlated, tremor that a window averages away: both last tens of
    milliseconds, so the two edges of a fast crossing share them.
    """
    lag = (edge_t_s[:, None] - edge_t_s[None, :]) / SCATTER_LASTS_S
    return np.asarray(np.exp(-0.5 * lag**2) + 0.02 * np.eye(edge_t_s.size))


def _weighted_fit(
    design: FloatArray,
    response: FloatArray,
    covariance: FloatArray,
    extra: FloatArray,
    known_tau_mm: float | None = None,
) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Generalised least squares with the extra scatter τ that makes χ² equal its expectation (Paule–Mandel)."""
    n = response.size
    prior = np.zeros(design.shape[1])
    prior[4] = 1 / SPEED_SLOPE_SD_S**2
    dof = max(n - 4, 1)
    identity = np.eye(n)
    jitter = 1e-9 * float(np.trace(covariance)) / n + 1e-12

    def fitted(tau2: float) -> tuple[float, FloatArray, FloatArray, FloatArray]:
        factor = cho_factor(covariance + tau2 * extra + jitter * identity)
        whitened = cho_solve(factor, design)
        spread = np.linalg.inv(design.T @ whitened + np.diag(prior))
        estimate = spread @ (whitened.T @ response)
        residual = response - design @ estimate
        chi2 = float(residual @ cho_solve(factor, residual)) + float(prior @ estimate**2)
        return chi2, estimate, spread, residual

    if known_tau_mm is not None:
        _, estimate, spread, residual = fitted(known_tau_mm**2)
        return estimate, spread, residual, known_tau_mm
    chi2, estimate, spread, residual = fitted(0.0)
    low, high, tau2 = 0.0, 4 * float(np.mean(residual**2)) + 1e-12, 0.0
    if chi2 > dof:
        for _ in range(9):
            tau2 = 0.5 * (low + high)
            chi2, estimate, spread, residual = fitted(tau2)
            low, high = (tau2, high) if chi2 > dof else (low, tau2)
    return estimate, spread, residual, float(np.sqrt(tau2))


def _outliers(residual: FloatArray, covariance: FloatArray) -> np.ndarray:
    """Edges that no stylus made: beyond 5 robust standard deviations of the rest, at most a fifth at a time."""
    scale = 1.4826 * float(np.median(np.abs(residual - np.median(residual))))
    expected = np.sqrt(np.diag(covariance))
    limit = 5 * np.maximum(expected, scale)
    out = np.abs(residual) > limit
    if np.count_nonzero(out) > 0.2 * residual.size:
        worst = np.argsort(-np.abs(residual / limit))[: int(0.2 * residual.size)]
        out = np.zeros_like(out)
        out[worst] = True
    return out


def _mean_speed(ready: Prepared, best: Solution) -> tuple[float, float]:
    """Mean speed at the edges and its standard error.

    A law that falls steeply makes the touch trace run fast and slow with every tremor, and the mean of such a speed
    reads up to 6 % high. So the window averages tremor away, but stays short against the path's turning: at
    ω · h = 0.8 a local cubic still reads speed right to 0.3 %. Noise across the motion adds half its variance over
    the speed, which is taken off again.
    """
    t_s, at_s = ready.touch.t_s, best.edges.t_s + best.latency_s
    first = local_fit(t_s, ready.xy_mm, at_s, max(0.1, best.narrow_s))
    cross = first.v_mm_s[:, 0] * first.a_mm_s2[:, 1] - first.v_mm_s[:, 1] * first.a_mm_s2[:, 0]
    turning = float(np.median(np.abs(cross) / np.maximum(first.speed_mm_s, 1.0) ** 2))
    half_s = float(np.clip(0.8 / max(turning, 0.1), best.narrow_s, 0.3))
    fit = local_fit(t_s, ready.xy_mm, at_s, half_s)
    fit = fit if fit.ok.all() else best.fit
    speed = fit.speed_mm_s
    noise2 = best.noise_mm**2 * fit.v_gain
    mean = float(np.mean(speed - noise2 / (2 * np.maximum(speed, 1.0))))
    # Edges of one crossing share their windows: half as many independent speeds as edges.
    return mean, float(np.sqrt(2 * np.mean(noise2) / speed.size))


def _describe(ready: Prepared, blank: RunEstimate, best: Solution) -> RunEstimate:
    latency_s, half_mm = best.latency_s, float(best.parameters[3])
    slope, middle = float(best.parameters[1]), float(best.parameters[2])
    lines = Lines(slope, slope, middle - half_mm, middle + half_mm)
    touch, n = ready.touch, best.edges.t_s.size
    raw = [np.interp(best.edges.t_s, touch.t_s, v) for v in (touch.x_mm, touch.y_mm)]
    alignment = Alignment(
        best.edges.t_s,
        raw[0],
        raw[1],
        best.fit.xy_mm[:, 0],
        best.fit.xy_mm[:, 1],
        best.side,
        best.edges.falling,
        best.residual_mm,
        np.full(n, latency_s),
        best.fit.speed_mm_s,
        best.fit.v_mm_s,
        lines,
    )
    reach = float(student.ppf(0.975, max(best.dof, 1))) * best.se_s
    x_mm = alignment.x_mm
    speed, speed_se = _mean_speed(ready, best)
    return replace(
        blank,
        n_edges=n,
        n_rejected=best.edges.n_rejected,
        speed_mm_s=speed,
        speed_se_mm_s=speed_se,
        latency_s=latency_s,
        latency_se_s=best.se_s,
        latency_ci95_s=(latency_s - reach, latency_s + reach),
        j0_per_edge_mm2=cost_without_shift(ready, best.edges),
        j_per_edge_mm2=float(np.mean(best.residual_mm**2)),
        stylus_diameter_mm=stylus_diameter_mm(lines, float(x_mm.min()), float(x_mm.max())),
        stylus_diameter_se_mm=2 * float(np.sqrt(best.covariance[3, 3])),
        alignment=alignment,
    )
