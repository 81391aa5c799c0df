"""Where a search ends: at the lowest cost under the likeliest weights."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from draglag.gap.fitting.descent import Search, lowered
from draglag.gap.fitting.likelihood import likeliest, likelihoods
from draglag.gap.fitting.model import base_prior
from draglag.gap.fitting.noise import BETWEEN, SLOW_MM, SPEED, Components, Scatter, scatter
from draglag.gap.fitting.state import State, usable
from draglag.gap.fitting.whitening import whitener
from draglag.gap.traces.run_data import RunData
from draglag.recording import FloatArray

FIXED = 1e9  # precision of a parameter at its bound: it does not move. Derived
WEIGHED = 3  # times that weights are taken again at the end of a search; once is usual. Derived: cost


@dataclass(frozen=True)
class Weighed:
    """A search under its weights, the run components to try with them, prior (p,), log-likelihood."""

    search: Search
    noises: tuple[Components, ...]
    prior: FloatArray
    log_likelihood: float


@dataclass(frozen=True)
class End:
    """Where a search has ended, without weights. begun: components that the likeliest are sought from."""

    state: State
    use: np.ndarray
    parts: Scatter
    prior: FloatArray
    value: Callable[[Components], float]
    begun: tuple[Components, ...]

    @classmethod
    def of(cls, runs: tuple[RunData, ...], search: Search, smaller: Components | None) -> End:
        state, components = search.state, search.components
        use = search.use & (usable(state, runs, loose=False) if smaller is None else state.placed.ok)
        parts = scatter(runs, state.placed, use, state.blur_mm)
        begun = [components, replace(components, slow_mm=SLOW_MM[0], speed=SPEED[-1])]
        if smaller is not None:
            begun.append(smaller)  # or the larger model may seem the less likely one
        prior = state.prior.copy()
        prior[: base_prior(state.law).size] = base_prior(state.law)
        at_bounds = state.law.at_bounds
        prior[: at_bounds.size][at_bounds] = FIXED  # what cannot move must not be credited for it
        value = likelihoods(parts, state.residual[use], state.design[use], prior)
        return cls(state, use, parts, prior, value, tuple(begun))

    def likeliest(self) -> Components:
        state, use = self.state, self.use
        found = likeliest(self.parts, state.residual[use], state.design[use], state.prior, self.begun)
        return max(_between(found), key=self.value)

    def under(self, components: Components) -> Weighed:
        there = Search(self.state, self.use, components, whitener(self.parts, components))
        return Weighed(there, _between(components), self.prior, self.value(components))


def _between(components: Components) -> tuple[Components, ...]:
    return tuple(replace(components, run_s=a, run_mm=b) for a, b in BETWEEN)


def concluded(runs: tuple[RunData, ...], search: Search, smaller: Components | None, width_mm: float) -> Weighed:
    """Where a search ends under its likeliest weights: it had others, and may have ended elsewhere.

    smaller: weights of a smaller model, whose edges are kept.
    """
    end = End.of(runs, search, smaller)
    here = end.under(end.likeliest())
    now = lowered(runs, here.search, width_mm)
    if now is here.search:
        return here
    end = End.of(runs, now, smaller)
    here = end.under(now.components)
    for _ in range(WEIGHED):
        likely = end.likeliest()
        if likely == now.components:
            break
        now = lowered(runs, end.under(likely).search, width_mm)
        end = End.of(runs, now, smaller)
        there = end.under(now.components)
        if there.log_likelihood <= here.log_likelihood:  # a linear law passes its bounds: other weights promised more
            break
        here = there
    return here
