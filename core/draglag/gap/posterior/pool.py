"""Explanations compared on the same edges and noises."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from draglag.gap import constants
from draglag.gap.fitting.joint import Fit, effects_in, effects_in_law
from draglag.gap.fitting.law_form import LAW_FORM
from draglag.gap.fitting.noise import Components
from draglag.gap.posterior.law_shape import falling_share
from draglag.gap.posterior.levels import is_sound
from draglag.gap.posterior.linear import Linear, likeliest_levels, linearised, normal
from draglag.gap.posterior.members import UNNAMED
from draglag.gap.posterior.search import Explanation, Search, log_evidence, one_law, own_effects, searched

Names = tuple[str, ...]
IN_SPEED = f"{UNNAMED}speed:latency"
"""A curve that does not fall with speed."""


@dataclass(frozen=True)
class Found:
    """Explanation at the linearisation where it is most probable."""

    log_mass: float
    search: Search
    explanation: Explanation


@dataclass(frozen=True)
class Pool:
    """Every set of names at its best fit.

    searches: one a fit. edges: common mask over placed edges.
    """

    searches: tuple[Search, ...]
    edges: np.ndarray
    levels: tuple[Components, ...]
    found: dict[Names, Found]
    unsure_ages: bool

    @property
    def best(self) -> Names:
        return max(self.found, key=lambda names: self.found[names].log_mass)

    @property
    def emptiest(self) -> Names:
        """Names in every fit."""
        return min(self.found, key=len)

    @property
    def total(self) -> float:
        return float(logsumexp([f.log_mass for f in self.found.values()]))

    def probabilities(self) -> dict[Names, float]:
        """Set of names → probability, falling."""
        total = self.total
        each = {names: float(np.exp(f.log_mass - total)) for names, f in self.found.items()}
        return dict(sorted(each.items(), key=lambda item: -item[1]))

    def probability_of(self, *any_of: str) -> float:
        """Probability that a name is in the explanation; of several, any of them."""
        return sum(p for names, p in self.probabilities().items() if not set(any_of).isdisjoint(names))

    def alone(self, name: str) -> float:
        """Log mass of one name alone; −∞ if not compared."""
        found = self.found.get(tuple(sorted({*self.emptiest, name})))
        return float("-inf") if found is None else found.log_mass

    def settings_of(self, names: Names) -> dict[str, tuple[float, ...]]:
        """Member → setting; empty if not compared."""
        found = self.found.get(names)
        if found is None:
            return {}
        members = [found.search.linear.members[i] for i in found.explanation.members]
        return {member.name: member.theta for member in members}

    def fit_of(self, names: Names) -> Fit:
        return self.found[names].search.linear.fit


def compared(
    fits: Sequence[Fit],
    allowed: Collection[str],
    unsure_ages: bool,
    without: Collection[str] = (),
    most: int = constants.MOST_EFFECTS,
    before: Pool | None = None,
) -> Pool:
    """Explanations at the fits, smallest first; a fit judges only sets with all its effects.

    before: keeps levels.
    """
    edges = np.logical_and.reduce([fit.use for fit in fits])
    made = () if before is None else before.searches
    known = {id(search.linear.fit): search.linear for search in made}
    linears = [
        known[id(fit)].on(edges) if id(fit) in known else linearised(fit, frozenset(allowed), unsure_ages, edges)
        for fit in fits
    ]
    levels: dict[Components, None] = {} if before is None else dict.fromkeys(before.levels)
    for linear in linears:
        if id(linear.fit) not in known:
            likely, search = likely_levels(linear, without, tuple(levels), most)
            levels |= dict.fromkeys(likely)
            made = (*made, search)
    found: dict[Names, Found] = {}
    searches = tuple(_searched(linear, tuple(levels), without, most, made) for linear in linears)
    for search in searches:
        for names, one in _by_names(search).items():
            if names not in found or one.log_mass > found[names].log_mass:
                found[names] = one
    kept = tuple(_that_matter(found, tuple(levels)))
    return Pool(searches, edges, kept, found, unsure_ages)


def _that_matter(found: dict[Names, Found], levels: tuple[Components, ...]) -> list[Components]:
    best, empty = max(found, key=lambda n: found[n].log_mass), min(found, key=len)
    each = np.array([log_evidence(found[n].search, found[n].explanation) for n in (best, empty)])
    near = each > each.max(axis=1, keepdims=True) - constants.GIVEN_UP
    return [one for one, keep in zip(levels, near.any(axis=0), strict=True) if keep]


def likely_levels(
    linear: Linear, without: Collection[str], seeds: tuple[Components, ...], most: int
) -> tuple[tuple[Components, ...], Search]:
    """Components likely with the fewest members and with the best explanation; its search."""
    out: dict[Components, None] = dict.fromkeys(seeds)
    if not out:
        found = likeliest_levels(linear)
        # A single run that lies off makes all runs seem to scatter: it is judged where the others scatter little, too.
        sound = replace(found, run_s=min(found.run_s, Components().run_s))
        out |= dict.fromkeys((*_and_sound(linear, found), *_and_sound(linear, sound)))
    search = _searched(linear, tuple(out), without, most)
    for one in _fewest_and_best(search):
        if one.members or seeds:  # with an effect of the law it may have no member
            likeliest = search.normals[int(np.argmax(log_evidence(search, one)))].levels
            levels = likeliest_levels(linear, one.members, one.scales_mm, likeliest)
            out |= dict.fromkeys(_and_sound(linear, levels))
    return tuple(out), search


def _and_sound(linear: Linear, levels: Components) -> tuple[Components, ...]:
    if is_sound(levels) or linear.unsure_ages:
        return (levels,)
    return levels, likeliest_levels(linear, start=levels, sound=True)


def _searched(
    linear: Linear, levels: tuple[Components, ...], without: Collection[str], most: int, made: Sequence[Search] = ()
) -> Search:
    made = [search for search in made if search.linear is linear]
    for search in made:
        if (search.levels, search.without, search.most) == (levels, frozenset(without), most):
            return search
    known = {one.levels: one for search in made for one in search.normals}
    normals = (known[one] if one in known else normal(linear, one) for one in levels)
    return searched(linear, tuple(normals), without, most)


def _fewest_and_best(search: Search) -> dict[Explanation, None]:
    """With all effects of the fit. Levels likely for the best alone would favour what it has in addition."""
    inside = set(own_effects(search.linear.fit))
    own = [e for e in search.explanations if not inside or inside <= set(search.names(e))]
    by_mass = sorted(own, key=lambda e: -e.log_mass)
    return dict.fromkeys([*sorted(by_mass, key=lambda e: e.size)[:1], *by_mass[:1]])


def _by_names(search: Search) -> dict[Names, Found]:
    """Masses summed over settings."""
    fit = search.linear.fit
    inside = set(effects_in(fit))
    of_law = effects_in_law(fit)
    prior = len(of_law) * float(np.log(constants.P_EFFECT))
    falls = _falling(search)
    masses: dict[Names, list[float]] = {}
    best: dict[Names, Explanation] = {}
    each = [member.name for member in search.linear.members]
    shapes: dict[Names, list[tuple[Names, float]]] = {}  # by the names of members, of which many have the same
    for one in search.explanations:
        listed = tuple([each[i] for i in one.members])
        if listed not in shapes:
            names = tuple(sorted([*listed, *of_law]))
            shapes[listed] = _by_shape(names, falls) if inside.issubset(names) and one_law(names) else []
        for named, log_share in shapes[listed]:
            masses.setdefault(named, []).append(one.log_mass + log_share)
            if named not in best or one.log_mass > best[named].log_mass:
                best[named] = one
    return {
        names: Found(float(np.logaddexp.reduce(mass)) + prior, search, best[names]) for names, mass in masses.items()
    }


def _falling(search: Search) -> float:
    """Probability that the curve falls; 1 if its own form is improbable."""
    forms = {i for i, member in enumerate(search.linear.members) if member.name == LAW_FORM}
    own = [e for e in search.explanations if not forms.isdisjoint(e.members)]
    if not own:
        return 1.0
    best = max(own, key=lambda e: e.log_mass)
    if best.log_mass < search.best.log_mass - constants.GIVEN_UP:
        return 1.0
    levels = search.normals[int(np.argmax(log_evidence(search, best)))]
    return falling_share(search.linear, levels, best.members, best.scales_mm)


def _by_shape(names: Names, falls: float) -> list[tuple[Names, float]]:
    """Log shares of a falling law and of unnamed structure."""
    if LAW_FORM not in names or falls >= 1.0:
        return [(names, 0.0)]
    bump = tuple(sorted((*(n for n in names if n != LAW_FORM), IN_SPEED)))
    even = np.log(constants.P_FALLING)
    odd = np.log1p(-constants.P_FALLING) + np.log(constants.P_LAW_FORM / constants.P_SMOOTH)
    return [(names, float(np.log(falls) - even)), (bump, float(np.log1p(-falls) - odd))]


def unsound_share(pool: Pool, names: Names) -> float:
    """Probability of excess scatter, given an explanation."""
    found = pool.found[names]
    search = found.search
    if search.linear.unsure_ages:
        return 0.0
    each = log_evidence(search, found.explanation)
    weights = np.exp(each - logsumexp(each))
    return float(sum(w for w, one in zip(weights, search.normals, strict=True) if not is_sound(one.levels)))
