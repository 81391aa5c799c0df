"""Where a search ends: at the lowest cost under the likeliest weights."""

from __future__ import annotations

from dataclasses import dataclass, replace

from draglag.gap.fitting.descent import Search, lowered
from draglag.gap.fitting.likelihood import likeliest, likelihoods
from draglag.gap.fitting.model import base_prior
from draglag.gap.fitting.noise import BETWEEN, EDGE_MM, SPEED, Components, scatter
from draglag.gap.fitting.state import usable
from draglag.gap.fitting.whitening import whitener
from draglag.gap.traces.run_data import RunData
from draglag.recording import FloatArray

FIXED = 1e9  # precision of a parameter at its bound: it does not move. Derived
WEIGHED = 3  # times that weights are taken again at the end of a search; once is usual. Derived: cost


@dataclass(frozen=True)
class Weighed:
    """A search under its likeliest weights, and what they are of: run components tried, prior (p,), log-likelihood."""

    search: Search
    noises: tuple[Components, ...]
    prior: FloatArray
    log_likelihood: float


def _weighed(
    runs: tuple[RunData, ...], search: Search, smaller: Components | None, kept: Components | None = None
) -> Weighed:
    """smaller: weights of a smaller model, whose edges are kept. kept: weights; None: the likeliest."""
    state, components = search.state, search.components
    use = search.use & (usable(state, runs, loose=False) if smaller is None else state.placed.ok)
    parts = scatter(runs, state.placed, use, state.blur_mm)
    begun = [components, replace(components, edge_mm=EDGE_MM[0], speed=SPEED[-1])]
    if smaller is not None:
        begun.append(smaller)  # or the larger model may seem the less likely one
    residual, design, prior = state.residual[use], state.design[use], state.prior.copy()
    components = kept or likeliest(parts, residual, design, state.prior, begun)
    noises = tuple(replace(components, run_s=a, run_mm=b) for a, b in BETWEEN)
    prior[: base_prior(state.law).size] = base_prior(state.law)
    prior[: state.law.at_bounds.size][state.law.at_bounds] = FIXED  # what cannot move must not be credited for it
    value = likelihoods(parts, residual, design, prior)
    best = kept or max(noises, key=value)
    return Weighed(Search(state, use, best, whitener(parts, best)), noises, prior, value(best))


def concluded(runs: tuple[RunData, ...], search: Search, smaller: Components | None, width_mm: float) -> Weighed:
    """Where a search ends under its likeliest weights: it had others, and may have ended elsewhere.

    smaller: weights of a smaller model, whose edges are kept.
    """
    here = _weighed(runs, search, smaller)
    now = lowered(runs, here.search, width_mm)
    if now is here.search:
        return here
    here = _weighed(runs, now, smaller, now.components)
    for _ in range(WEIGHED):
        again = _weighed(runs, now, smaller)
        if again.search.components == now.components:
            break
        now = lowered(runs, again.search, width_mm)
        there = _weighed(runs, now, smaller, now.components)
        if there.log_likelihood <= here.log_likelihood:  # a linear law passes its bounds, and promised them more
            break
        here = there
    return here
