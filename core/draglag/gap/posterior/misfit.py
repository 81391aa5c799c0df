"""What misfit too small to matter leaves open of the parameters of a fit."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from draglag.gap import constants
from draglag.gap.constants import LEAST_PRECISION
from draglag.gap.fitting.joint import Fit, effects_in
from draglag.gap.fitting.noise import scatter
from draglag.gap.fitting.parameters import parameters_of
from draglag.gap.posterior.linear import tolerance_of
from draglag.gap.posterior.members import members_of
from draglag.recording import FloatArray
from draglag.simulation.effects import EFFECTS
from draglag.simulation.effects.in_fits import Parameters


def parameters_with_misfit(effect: str, fit: Fit) -> Parameters:
    """Parameters of an effect, with intervals that hold what tolerated misfit makes of them."""
    return parameters_of(effect, fit, misfit_sd(fit))


@lru_cache(maxsize=4)
def misfit_sd(fit: Fit, scales_mm: tuple[float, ...] = constants.MISFIT_MM) -> FloatArray:
    """Standard deviation of each linear parameter about its fitted value, (p,), if tolerated shapes may be there.

    Their scale is not known: each of ``scales_mm``, none first, counts by its evidence (Rasmussen & Williams 2006,
    section 5.4).
    """
    own = {*effects_in(fit), *(term.effect for term in fit.terms)}
    parts = scatter(fit.runs, fit.placed, fit.use, fit.blur_mm)
    others = [member for member in members_of(fit, parts, frozenset(EFFECTS)) if member.name not in own]
    tolerance, singular = tolerance_of(fit, others)
    white = fit.white.apply(np.column_stack([fit.design, tolerance, fit.residual_mm]))
    gram, moment = white[:, :-1].T @ white[:, :-1], white[:, :-1].T @ white[:, -1]
    prior = np.maximum(fit.prior, LEAST_PRECISION)
    precisions = [np.append(prior, (s * singular) ** -2.0) if s else prior for s in scales_mm]
    found = [_posterior(gram, moment, precision, prior.size) for precision in precisions]
    evidence = np.array([value for value, _, _ in found])
    weight = np.exp(evidence - evidence.max())
    fitted = found[0][1]
    square = np.array([variance + (mean - fitted) ** 2 for _, mean, variance in found])
    return np.asarray(np.sqrt(weight @ square / weight.sum()))


def _posterior(
    gram: FloatArray, moment: FloatArray, precision: FloatArray, p: int
) -> tuple[float, FloatArray, FloatArray]:
    """Log evidence, and mean and variance of the first p columns. precision: prior, of the first n columns, (n,)."""
    n = precision.size
    information = gram[:n, :n] + np.diag(precision)
    unit = 1 / np.sqrt(np.diag(information))
    value, vector = np.linalg.eigh(information * unit[:, None] * unit)
    value = np.maximum(value, n * np.finfo(float).eps * value[-1])  # columns may be alike in a short session
    along = vector.T @ (unit * moment[:n])
    mean = unit * (vector @ (along / value))
    variance = unit**2 * np.sum(vector**2 / value, axis=1)
    evidence = 0.5 * float(along**2 @ (1 / value) + np.log(precision).sum() - np.log(value).sum())
    return evidence + float(np.log(unit).sum()), mean[:p], variance[:p]
