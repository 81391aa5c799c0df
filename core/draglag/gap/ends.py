"""Where the curve of latency against speed may end, by what a fit knows of it at the speeds measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import logsumexp

from draglag.curve.forms import FORMS, Form
from draglag.gap.constants import P_EFFECT, P_LAW_FORM, SIZE_OF_INTEREST_MM
from draglag.gap.fitting.joint import Fit
from draglag.recording import FloatArray

KNOTS = 24  # speeds, in even steps of ln v: a fifth of it apart, where differences of laws are straight. Derived
STEP_S = 0.0005  # of the ends that are tried: half of what releases scatter by. Derived
CLOCKS_OFF_S = 0.03  # below zero that ends are tried: clocks that nobody compared differ by some 10 ms. Physical
# Mean of what curves fall on beyond the fastest speed, over their fall in the last doubling of speed: a low-pass 1, a
# logarithm of the speed 1.6, a root 2.4 times. Derived
AS_MUCH_AGAIN = 2.0
LEAST = 1e-300  # of a probability, whose logarithm is taken. Derived
ROUNDS = 30  # of Levenberg and Marquardt's, of all ends at once. Derived: cost
LEAST_S = 1e-7  # of an amplitude, whose logarithm is fitted. Derived
TRIVIAL = 1e-9  # of the largest information: directions of less are rounding. Derived


@dataclass(frozen=True)
class _Known:
    """What a fit knows of its law: −2 ln likelihood = |root δ + off|², (k, K) and (k,), of its change δ (K,) s."""

    speeds_mm_s: FloatArray
    latencies_s: FloatArray
    root: FloatArray
    off: FloatArray

    def costs(self, laws_s: FloatArray) -> FloatArray:
        """Residuals (n, k) of laws (n, K)."""
        return np.asarray((laws_s - self.latencies_s) @ self.root.T + self.off)


def possible_ends(fit: Fit, p_other: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Latencies (n,) s at which the curve may end far beyond the fastest speed, and their probabilities.

    Before any form is fitted, a curve falls on by as much as it fell last, and below zero only on clocks that are off;
    then by the likeliest curve of each form that ends there. p_other: of another form than these.
    """
    fastest = float(np.quantile(fit.view.speed, 0.95))
    before_s, last_s = fit.law(np.array([fastest / 2, fastest]))
    ends_s = np.arange(last_s, min(last_s, 0.0) - CLOCKS_OFF_S, -STEP_S)[::-1]
    falls_on = np.exp(-(last_s - ends_s) / max(AS_MUCH_AGAIN * (before_s - last_s), STEP_S))
    falls_on *= np.where(ends_s < 0, P_EFFECT, 1.0)
    known = _known(fit)
    # One exponential and a constant are special cases of Eq. 5.
    other = 0.5 * P_LAW_FORM
    priors = {"double_exponential": 1 - P_LAW_FORM, "adaptive_low_pass": other, "power": other}
    logs = [np.log(prior) - 0.5 * _least_costs(known, FORMS[name], ends_s) for name, prior in priors.items()]
    log_p = np.log(np.maximum(falls_on, LEAST)) + logsumexp(logs, axis=0)
    return ends_s, (1 - p_other) * np.exp(log_p - logsumexp(log_p)) + p_other * falls_on / falls_on.sum()


def _known(fit: Fit) -> _Known:
    speed = np.maximum(fit.view.speed, max(fit.law.plateau_mm_s, 1.0))  # on a plateau no run shows how the curve falls
    speeds = np.geomspace(float(speed.min()), float(speed.max()) * (1 + 1e-9), KNOTS)
    place = np.interp(np.log(speed), np.log(speeds), np.arange(KNOTS))
    hats = np.maximum(1 - np.abs(place[:, None] - np.arange(KNOTS)), 0.0)
    lever = fit.view.v_across * fit.view.stretch
    n_law = len(fit.law.step_sd)
    white = fit.white.apply(np.column_stack([lever[:, None] * hats, fit.residual_mm, fit.design[:, n_law:]]))
    law, rest = white[:, : KNOTS + 1], white[:, KNOTS + 1 :]
    across = rest.T @ law
    information = law.T @ law
    information -= across.T @ np.linalg.pinv(rest.T @ rest + np.diag(fit.prior[n_law:]), hermitian=True) @ across
    size, axes = np.linalg.eigh(information[:KNOTS, :KNOTS])
    sure = size > TRIVIAL * size[-1]
    root = np.sqrt(size[sure])[:, None] * axes[:, sure].T
    off = axes[:, sure].T @ information[:KNOTS, KNOTS] / np.sqrt(size[sure])
    # Laws follow a form to what is of interest only.
    loose = root * (SIZE_OF_INTEREST_MM / speeds)
    white = solve_triangular(
        np.linalg.cholesky(np.eye(off.size) + loose @ loose.T), np.column_stack([root, off]), lower=True
    )
    return _Known(speeds, fit.law(speeds), white[:, :-1], white[:, -1])


def _least_costs(known: _Known, form: Form, ends_s: FloatArray) -> FloatArray:
    """Least |residual|² (n,) of the form's curves that end there."""
    theta, amplitudes_s = _begun(known, form, ends_s)
    at = np.log(np.column_stack([theta, np.maximum(amplitudes_s, LEAST_S)]))
    bounds = np.log(form.lower), np.log(form.upper)
    left, slopes = _linearised(known, form, at, ends_s)
    cost, damping = np.sum(left**2, axis=1), np.full(ends_s.size, 1e-2)
    for _ in range(ROUNDS):
        curvature = np.einsum("nkp,nkq->npq", slopes, slopes)
        scale = np.einsum("npp->np", curvature)
        curvature[:, np.arange(at.shape[1]), np.arange(at.shape[1])] += damping[:, None] * scale + TRIVIAL
        step = np.linalg.solve(curvature, np.einsum("nkp,nk->np", slopes, -left)[..., None])[..., 0]
        new = at + step.clip(-1, 1)
        new[:, : theta.shape[1]] = new[:, : theta.shape[1]].clip(*bounds)
        new_left, new_slopes = _linearised(known, form, new, ends_s)
        new_cost = np.sum(new_left**2, axis=1)
        better = new_cost < cost
        at, cost = np.where(better[:, None], new, at), np.where(better, new_cost, cost)
        left, slopes = np.where(better[:, None], new_left, left), np.where(better[:, None, None], new_slopes, slopes)
        damping = np.where(better, damping / 5, damping * 5)
    return np.asarray(cost)


def _linearised(known: _Known, form: Form, at: FloatArray, ends_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Residuals (n, k) and their derivatives (n, k, p) by the logarithms ``at`` (n, p) of shapes and amplitudes."""
    n_shapes = form.lower.size

    def shapes(ln: FloatArray) -> FloatArray:
        return form.columns(np.exp(ln), known.speeds_mm_s)[:, :, :-1]

    columns, amplitudes = shapes(at[:, :n_shapes]), np.exp(at[:, n_shapes:])
    own = columns * amplitudes[:, None]
    slopes = []
    for k in range(n_shapes):
        more = at[:, :n_shapes].copy()
        more[:, k] += 1e-4
        slopes.append(np.einsum("nKp,np->nK", shapes(more) - columns, amplitudes) / 1e-4)
    by = np.concatenate([np.stack(slopes, axis=2), own], axis=2)
    return known.costs(own.sum(axis=2) + ends_s[:, None]), np.einsum("kK,nKp->nkp", known.root, by)


def _begun(known: _Known, form: Form, ends_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Of the form's grid, the best shapes (n, s) of curves that end there, and their amplitudes (n, p) s."""
    columns = form.columns(form.grid, known.speeds_mm_s)[:, :, :-1]
    white = np.einsum("kK,gKp->gkp", known.root, columns)
    left = known.costs(np.broadcast_to(ends_s[:, None], (ends_s.size, known.speeds_mm_s.size)))
    moment = -np.einsum("gkp,nk->gnp", white, left)
    curvature = np.einsum("gkp,gkq->gpq", white, white)
    best_gain = np.full((form.grid.shape[0], ends_s.size), -np.inf)
    best = np.zeros_like(moment)
    n_p = columns.shape[2]
    for used in [[k] for k in range(n_p)] + ([list(range(n_p))] if n_p > 1 else []):
        own = curvature[:, used][:, :, used] + TRIVIAL * np.eye(len(used))
        amplitudes = np.linalg.solve(own, np.swapaxes(moment[:, :, used], 1, 2))  # (g, u, n)
        gain = np.einsum("gun,gnu->gn", amplitudes, moment[:, :, used])
        better = (amplitudes >= 0).all(axis=1) & (gain > best_gain)
        best_gain = np.where(better, gain, best_gain)
        full = np.zeros_like(moment)
        full[:, :, used] = np.swapaxes(amplitudes, 1, 2)
        best = np.where(better[:, :, None], full, best)
    grid = np.argmax(best_gain, axis=0)
    return form.grid[grid], best[grid, np.arange(ends_s.size)]
