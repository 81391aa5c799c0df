"""Parameters of a fitted effect."""

from __future__ import annotations

import numpy as np

from draglag.gap.fitting.jackknife import jackknife_sd
from draglag.gap.fitting.joint import Fit
from draglag.gap.fitting.model import base_prior
from draglag.gap.fitting.state import Term, term_signature, view_with_terms
from draglag.recording import FloatArray
from draglag.simulation.effects import column_of, effect_class
from draglag.simulation.effects.in_fits import FittedTerm, Parameters


def parameters_of(effect: str, fit: Fit, misfit_sd: FloatArray | None = None) -> Parameters:
    """Parameters of an effect; empty if the fit has none. misfit_sd: (p,) of linear parameters, by misfit and noise."""
    home = effect_class(effect)
    if home.of_the_law:
        return home.law_parameters(fit)
    term_id = column_of(effect)
    at = base_prior(fit.law).size
    for term in fit.terms:
        k = len(term.sizes)
        if term.effect == term_id:
            return home.parameters_in(_fitted(term, fit, slice(at, at + k), misfit_sd))
        at += k
    return {}


def whole_size_mm(fit: Fit, effect: str) -> float | None:
    """RMS shift of all placed edges to first order; None if not in the fit."""
    column, placed = column_of(effect), fit.placed
    view = view_with_terms(placed, fit.law, fit.geometry, fit.terms, fit.width_mm)
    for term in fit.terms:
        if term.effect == column:
            columns = term_signature(term, view).columns(view)
            moved_mm = columns[placed.ok] @ effect_class(column).whole_sizes(term, fit)
            return float(np.sqrt(np.mean(moved_mm[np.isfinite(moved_mm)] ** 2)))
    return None


def _fitted(term: Term, fit: Fit, own: slice, misfit_sd: FloatArray | None) -> FittedTerm:
    se = np.maximum(np.sqrt(np.maximum(np.diag(fit.covariance)[own], 0)), jackknife_sd(fit)[own])
    se = se if misfit_sd is None else np.maximum(se, misfit_sd[own])
    return FittedTerm(fit, term, own, effect_class(term.effect).whole_sizes(term, fit), se)


def where_of(effect: str, fit: Fit) -> str:
    home = effect_class(effect)
    return home.where_in(fit) or home.where
