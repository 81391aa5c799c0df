"""Where the curve of latency against speed may end, by what a fit knows of it at the speeds measured."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import logsumexp

from draglag.curve.forms import FORMS, Form
from draglag.curve.points import CurvePoints
from draglag.curve.separable import evaluated_ms, solved
from draglag.gap.constants import P_EFFECT, P_LAW_FORM, SIZE_OF_INTEREST_MM
from draglag.gap.fitting.joint import Fit
from draglag.recording import FloatArray

KNOTS = 24  # speeds, in even steps of ln v: a fifth of it apart, where differences of laws are straight. Derived
STEP_S = 0.001  # of the ends that are tried: what releases scatter by. Derived
OFFSET_SD_S = 0.01  # of an offset of interest: clocks that nobody compared differ by some milliseconds. Physical
# Mean of what curves fall on beyond the fastest speed, over their fall in the last doubling of speed: a low-pass 1, a
# logarithm of the speed 1.6, a root 2.4 times. Derived
AS_MUCH_AGAIN = 2.0
IMPROBABLE = 20.0  # nats. Ends by so much less likely than a higher one are none: no stated figure shows e⁻²⁰. Derived
TRIVIAL = 1e-9  # of the largest information: directions of less are rounding. Derived


def possible_ends(fit: Fit, p_other: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Latencies (n,) s at which the curve may end far beyond the fastest speed, and their probabilities.

    Before any form is fitted, a curve falls on by as much as it fell last, and below zero only on clocks that are off;
    then by the likeliest curve of each form that ends there. p_other: of another form than these.
    """
    ends_s, falls_on, likelihood = _weighed(fit)
    known = falls_on + likelihood
    each = (np.log1p(-p_other) + known - logsumexp(known)) if p_other < 1 else np.full(known.size, -np.inf)
    other = np.exp(falls_on - logsumexp(falls_on))
    return ends_s, np.exp(each) + p_other * other


@lru_cache(maxsize=1)
def _weighed(fit: Fit) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Ends (n,), and of each the log probability before and the log likelihood, both but for a constant."""
    fastest = float(np.quantile(fit.view.speed, 0.95))
    before_s, last_s = fit.law(np.array([fastest / 2, fastest]))
    ends_s = np.arange(last_s, min(last_s, 0.0) - 3 * OFFSET_SD_S, -STEP_S)[::-1]
    falls_on = -(last_s - ends_s) / max(AS_MUCH_AGAIN * (before_s - last_s), STEP_S)
    falls_on += np.where(ends_s < 0, np.log(P_EFFECT), 0.0)
    points, white = _known(fit)
    # One exponential and a constant are special cases of Eq. 5.
    other = 0.5 * P_LAW_FORM
    priors = {"double_exponential": 1 - P_LAW_FORM, "adaptive_low_pass": other, "power": other}
    each = [np.log(prior) - 0.5 * _least_costs(FORMS[name], points, white, ends_s) for name, prior in priors.items()]
    return ends_s, falls_on, np.asarray(logsumexp(each, axis=0))


def _least_costs(form: Form, points: CurvePoints, white: FloatArray, ends_s: FloatArray) -> FloatArray:
    """−2 ln likelihood of the form's likeliest curve at each rising end, (n,); ∞ below those that may be."""
    out = np.full(ends_s.size, np.inf)
    for k in reversed(range(ends_s.size)):
        values = solved(form, points, white, float(ends_s[k]), None)
        missed = white @ (1e-3 * evaluated_ms(form, values, points.speed_mm_s) - points.latency_s)
        out[k] = float(missed @ missed)
        if out[k] > out.min() + 2 * IMPROBABLE:
            break
    return out


def _known(fit: Fit) -> tuple[CurvePoints, FloatArray]:
    """What a fit knows of its law: points of it, and what whitens their errors, (k, n) 1/s.

    Laws follow a form to what is of interest only, which is a part of the errors.
    """
    speed = np.maximum(fit.view.speed, max(fit.law.plateau_mm_s, 1.0))  # on a plateau no run shows how the curve falls
    speeds = np.geomspace(float(speed.min()), float(speed.max()) * (1 + 1e-9), KNOTS)
    place = np.interp(np.log(speed), np.log(speeds), np.arange(KNOTS))
    hats = np.maximum(1 - np.abs(place[:, None] - np.arange(KNOTS)), 0.0)
    lever = fit.view.v_across * fit.view.stretch
    n_law = len(fit.law.step_sd)
    edges = fit.white.apply(np.column_stack([lever[:, None] * hats, fit.residual_mm, fit.design[:, n_law:]]))
    law, rest = edges[:, : KNOTS + 1], edges[:, KNOTS + 1 :]
    across = rest.T @ law
    information = law.T @ law
    information -= across.T @ np.linalg.pinv(rest.T @ rest + np.diag(fit.prior[n_law:]), hermitian=True) @ across
    size, axes = np.linalg.eigh(information[:KNOTS, :KNOTS])
    sure = size > TRIVIAL * size[-1]
    root = np.sqrt(size[sure])[:, None] * axes[:, sure].T
    latency_s = fit.law(speeds) - axes[:, sure] @ ((axes[:, sure].T @ information[:KNOTS, KNOTS]) / size[sure])
    loose = root * (SIZE_OF_INTEREST_MM / speeds)
    white = solve_triangular(np.linalg.cholesky(np.eye(root.shape[0]) + loose @ loose.T), root, lower=True)
    return CurvePoints(speeds, latency_s, np.ones(KNOTS)), white
