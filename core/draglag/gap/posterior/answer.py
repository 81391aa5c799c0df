"""The posterior's answer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from draglag.gap import constants
from draglag.gap.fitting.heldout import gap_mm
from draglag.gap.fitting.joint import Fit, effects_in
from draglag.gap.fitting.law_form import LAW_FORM
from draglag.gap.fitting.parameters import whole_size_mm
from draglag.gap.posterior.members import UNNAMED
from draglag.gap.posterior.pool import IN_SPEED, Names, Pool, unsound_share
from draglag.gap.posterior.search import sizes_mm
from draglag.simulation.effects import EFFECTS, effect_class
from draglag.simulation.effects.in_fits import Z95

SCATTER = "scatter"
# Of probability: below it an explanation counts as it stands, whatever its members' sizes. Derived: cost.
WORTH_ITS_SIZE = 0.01
REPORTED = 0.95  # of the mass. Judgement: the usual share


@dataclass(frozen=True)
class Answer:
    """What a pool says before held-out runs and the session simulated again are asked.

    unexplained_by: covariate of what has no name, None without. explanations: this one first, ``unexplained`` if
    unnamed. tolerated: covariate or effect id, probability, size in mm.
    """

    effects: Names
    unexplained_by: str | None
    probability: float
    explanations: tuple[tuple[Names, float], ...]
    tolerated: tuple[tuple[str, float, float], ...]


def answer_of(pool: Pool) -> Answer:
    """The most probable explanation, nothing only if it is more probable than not, and those that share the mass."""
    sets: dict[Names, float] = {}
    leading: dict[Names, Names] = {}
    for names, p in pool.probabilities().items():
        reduced = _of_interest(pool, names) if p > WORTH_ITS_SIZE else _without_form(names)
        unnamed = any(name.startswith(UNNAMED) for name in reduced)
        key = ("unexplained",) if unnamed else reduced
        sets[key] = sets.get(key, 0.0) + p
        leading.setdefault(key, names)
    unsound = unsound_share(pool, pool.best)
    scatters = unsound > sets.get(("unexplained",), 0.0)
    if unsound:
        sets = {key: p * (1 - unsound) for key, p in sets.items() if key != ("unexplained",)}
        sets["unexplained",] = 1 - sum(sets.values())
        leading.setdefault(("unexplained",), pool.best)
    ranked = sorted(sets.items(), key=lambda item: -item[1])
    if ranked[0][0] == () and ranked[0][1] < constants.PROBABLE and len(ranked) > 1:
        ranked[:2] = reversed(ranked[:2])
    best, p = ranked[0]
    names = leading[best]
    by = None
    if best == ("unexplained",):
        by = SCATTER if scatters else _leading_covariate(pool, names)
    shown, total = [], 0.0
    for key, share in ranked:
        shown.append((key, min(share, constants.STATED_AT_MOST)))
        total += share
        if total > REPORTED:
            break
    effects = _that_stand(pool, names)
    return Answer(effects, by, min(p, constants.STATED_AT_MOST), tuple(shown), _tolerated(pool, names))


def _that_stand(pool: Pool, names: Names) -> Names:
    """Effects of interest whose covariate no unnamed term follows."""
    kept = _of_interest(pool, names)
    unnamed = {name.removeprefix(UNNAMED).partition(":")[0] for name in kept if name.startswith(UNNAMED)}
    return tuple(name for name in kept if name in EFFECTS and effect_class(name).follows not in unnamed)


def _sizes(pool: Pool, names: Names) -> dict[str, float]:
    """Sizes, with what is undone in traces or in the law."""
    found = pool.found[names]
    out = sizes_mm(found.search, found.explanation)
    fit = pool.fit_of(names)
    for name in names:
        whole_mm = whole_size_mm(fit, name) if name in EFFECTS else None
        if whole_mm is not None:
            small = whole_mm < constants.SIZE_OF_INTEREST_MM
            out[name] = max(whole_mm, _shrinks_by_mm(pool, fit, name)) if small else whole_mm
    return {IN_SPEED if name == LAW_FORM and IN_SPEED in names else name: size for name, size in out.items()}


def _shrinks_by_mm(pool: Pool, fit: Fit, name: str) -> float:
    """By how much less the gap is with an effect in the fit; 0 without a fit to compare.

    An effect that moves few edges may keep the others from being weighted as they deserve.
    """
    rest = tuple(one for one in effects_in(fit) if one != name)
    without = next((s.linear.fit for s in pool.searches if effects_in(s.linear.fit) == rest), None)
    return 0.0 if without is None else gap_mm(without, pool.edges) - gap_mm(fit, pool.edges)


def _without_form(names: Names) -> Names:
    return tuple(name for name in names if name != LAW_FORM)


def _of_interest(pool: Pool, names: Names) -> Names:
    """Members of interest, without the curve's form and unnamed terms within the uncertainty of an effect's columns."""
    sizes = _sizes(pool, names)
    open_mm = {
        effect_class(name).follows: Z95 * effect_class(name).unsure_share * sizes.get(name, 1.0)
        for name in names
        if name in EFFECTS
    }
    out = []
    for name in _without_form(names):
        least_mm = open_mm.get(name.removeprefix(UNNAMED).partition(":")[0], 0.0) if name.startswith(UNNAMED) else 0.0
        if sizes.get(name, np.inf) >= max(constants.SIZE_OF_INTEREST_MM, least_mm):
            out.append(name)
    return tuple(dict.fromkeys(out))


def _leading_covariate(pool: Pool, names: Names) -> str:
    sizes = {n: s for n, s in _sizes(pool, names).items() if n.startswith(UNNAMED)}
    if not sizes:
        return SCATTER
    return max(sizes, key=lambda n: sizes[n]).removeprefix(UNNAMED).partition(":")[0]


def _tolerated(pool: Pool, names: Names) -> tuple[tuple[str, float, float], ...]:
    kept = _of_interest(pool, names)
    sizes = _sizes(pool, names)
    return tuple(
        (
            name.removeprefix(UNNAMED).partition(":")[0],
            min(pool.probability_of(name), constants.STATED_AT_MOST),
            sizes[name],
        )
        for name in dict.fromkeys(_without_form(names))
        if name not in kept and name in sizes
    )
