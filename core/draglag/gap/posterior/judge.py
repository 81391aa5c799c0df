"""Search for the most probable explanation."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import partial

import numpy as np

from draglag.errors import EstimateError
from draglag.gap import constants
from draglag.gap.fitting.joint import Fit, effects_in, fit_session, gained_nats, log_likelihood_on
from draglag.gap.fitting.law_form import LAW_FORM, flexible, knots_over
from draglag.gap.fitting.parameters import parameters_of
from draglag.gap.posterior.members import UNNAMED
from draglag.gap.posterior.pool import IN_SPEED, Names, Pool, compared, unsound_share
from draglag.gap.proposing.of_effect import refit_module
from draglag.gap.proposing.proposals import refits_with, shown_by_edges, shown_by_traces
from draglag.recording import Session
from draglag.simulation.effects import EFFECTS

PROPOSED = 3  # effects that are then refitted. Derived: cost
Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class Judgement:
    """All explanations compared. fits: by effects, the initial one first."""

    pool: Pool
    fits: dict[Names, Fit]

    @property
    def base(self) -> Fit:
        """Initial fit."""
        return next(iter(self.fits.values()))


def judged(
    session: Session,
    first: Fit,
    allowed: Collection[str],
    unsure_ages: bool,
    most_effects: int = constants.MOST_EFFECTS,
    progress: Progress = lambda fraction, text: None,
) -> Judgement:
    """Posterior over explanations, from a first fit; from one with the curve's own form if that is more probable than
    not in the end. Which of both is begun with is what the first fit says."""
    compare = partial(compared, allowed=allowed, unsure_ages=unsure_ages, most=most_effects)
    explore = partial(_explored, session, allowed=frozenset(allowed), most_effects=most_effects, compare=compare)
    pool = compare([first])
    if effects_in(first):
        return explore({effects_in(first): first}, pool, progress=progress)
    begins = _has_own_form(pool)
    found: dict[bool, Judgement] = {}
    for own_form in (begins, not begins):
        begin = with_own_form(session, first) if own_form else first
        if own_form and begin is first:
            continue
        fits: dict[Names, Fit] = {(): begin}
        for other in found.values():
            fits |= grown(session, fits, other.pool, _effects_of(other.pool.best))
        pool = pool if list(fits.values()) == [first] else compare(list(fits.values()))
        found[own_form] = explore(fits, pool, progress=partial(_half, progress, 0.5 * len(found)))
        if _has_own_form(found[own_form].pool) == own_form:
            return found[own_form]
    return found[False]


def _half(progress: Progress, begin: float, part: float, text: str) -> None:
    progress(begin + 0.5 * part, text)


def _explored(
    session: Session,
    fits: dict[Names, Fit],
    pool: Pool,
    allowed: frozenset[str],
    most_effects: int,
    compare: Callable[..., Pool],
    progress: Progress,
) -> Judgement:
    """Search from fits, the smallest first: refits of what is probable, compared until the most probable set stays."""
    inside = next(iter(fits))
    barred: set[str] = set()
    proposed: set[Names] = set()
    tried: set[tuple[Names, str]] = set()
    asked: set[Names] = set()
    if most_effects > 0 and _in_doubt(pool):
        # What single edges show comes before what columns promise: other effects stand in for it, one after another.
        found = _proposed(session, pool, fits, _seen_in_edges(fits, allowed), (inside,), tried)
        fits |= found
        pool = compare(list(fits.values()), before=pool) if found else pool
    for k in range(constants.ROUNDS):
        progress((k + 1) / (constants.ROUNDS + 1), "comparing explanations")
        wanted = next((n for n in _probable(pool) if n not in fits and not set(n) & barred), _effects_of(pool.best))
        left = allowed - barred
        if wanted not in fits:
            found = grown_with_alike(session, fits, pool, wanted, barred, tried)
        elif most_effects > 0 and wanted not in asked:
            asked.add(wanted)
            found = _proposed(session, pool, fits, _rivals(pool, left), (inside,), tried)
            found |= _proposed(session, pool, fits, _shown(fits[wanted], left - set(wanted)), (wanted, inside), tried)
        elif wanted in proposed:
            break
        else:
            proposed.add(wanted)
            more = len(wanted) < most_effects and _in_doubt(pool)
            found = _with_one_less(session, pool, fits, (wanted, *(_probable(pool) if more else ())), tried)
            options = _promising(pool, fits, left) if more else []
            found |= _proposed(session, pool, fits, options, (wanted, inside), tried)
            if not found:
                break
        fits |= found
        pool = compare(list(fits.values()), without=barred, before=pool)
    return Judgement(pool, fits)


def _has_own_form(pool: Pool) -> bool:
    return pool.probability_of(LAW_FORM) + pool.probability_of(IN_SPEED) > constants.PROBABLE


def _unfitted(pool: Pool, wanted: Names, fits: dict[Names, Fit]) -> str:
    start = max((names for names in fits if set(names) <= set(wanted)), key=len)
    return max(set(wanted) - set(start), key=lambda name: pool.alone(name))


def with_own_form(session: Session, first: Fit) -> Fit:
    """Fit with the curve's own form, on the edges of ``first`` where it would leave out many; or ``first``."""
    enough = constants.LEAST_EDGES * np.count_nonzero(first.use)
    for start in (None, first):
        try:
            law = flexible(first.law, knots_over(first.view.speed))
            fit = fit_session(session, first.runs, (), False, start, law)
        except (EstimateError, np.linalg.LinAlgError, ValueError, FloatingPointError):
            continue
        if np.count_nonzero(fit.use) >= enough:
            return fit
    return first


def _effects_of(names: Names) -> Names:
    return tuple(name for name in names if name in EFFECTS)


def _probable(pool: Pool) -> list[Names]:
    sets: dict[Names, float] = {}
    for names, p in pool.probabilities().items():
        key = _effects_of(names)
        sets[key] = sets.get(key, 0.0) + p
    return [names for names in sorted(sets, key=lambda n: -sets[n]) if sets[names] > constants.DOUBT]


def _in_doubt(pool: Pool) -> bool:
    unnamed = sum(p for names, p in pool.probabilities().items() if any(n.startswith(UNNAMED) for n in names))
    return unnamed > constants.DOUBT or unsound_share(pool, pool.best) > constants.DOUBT


def _leading(pool: Pool, wanted: Names) -> Names:
    return next((names for names in pool.probabilities() if _effects_of(names) == wanted), pool.best)


def grown(
    session: Session, fits: dict[Names, Fit], pool: Pool, wanted: Names, tried: set[tuple[Names, str]] | None = None
) -> dict[Names, Fit]:
    """Refits, effects added one by one to the largest fitted subset."""
    names = max((names for names in fits if set(names) <= set(wanted)), key=len)
    theta = pool.settings_of(_leading(pool, wanted))
    base = next(iter(fits.values()))
    out: dict[Names, Fit] = {}
    for name in sorted(set(wanted) - set(names), key=lambda n: -pool.alone(n)):
        before = (fits | out)[names]
        if tried is not None:
            tried.add((names, name))
        fit = likeliest(refits_with(session, before, name, theta.get(name, ())), base, name)
        if fit is None or _loses(fit, before):
            break
        names = tuple(sorted((*names, name)))
        out[names] = fit
    return out


def grown_with_alike(
    session: Session, fits: dict[Names, Fit], pool: Pool, wanted: Names, barred: set[str], tried: set[tuple[Names, str]]
) -> dict[Names, Fit]:
    """``grown``, and other probable sets of as many effects: at the linearisation of the first they would all lose.

    barred: effects whose refits have lost, added to: other sets with them would begin with the same refit.
    """
    out = grown(session, fits, pool, wanted, tried)
    if wanted not in out:
        barred.add(_unfitted(pool, wanted, fits | out))
    for names in _probable(pool):
        if len(names) == len(wanted) and names not in fits | out and not set(names) & barred:
            out |= grown(session, fits | out, pool, names, tried)
    return out


def likeliest(options: list[Fit], base: Fit, effect: str) -> Fit | None:
    """Likeliest possible refit on shared edges; None if as small as on sound rigs."""
    enough = constants.LEAST_EDGES * np.count_nonzero(base.use)
    options = [fit for fit in options if np.count_nonzero(fit.use) >= enough and _possible(effect, fit)]
    if not options:
        return None
    both = np.logical_and.reduce([fit.use for fit in options])
    best = max(options, key=lambda fit: log_likelihood_on(fit, both))
    return None if _sound(effect, best) else best


def _loses(fit: Fit, before: Fit) -> bool:
    """Whether a refit is less likely than without its last effect: its columns promised what it cannot be.

    With another kind of law the two differ by more than the effect.
    """
    if type(fit.law) is not type(before.law):
        return False
    return gained_nats(before, fit) < -constants.GIVEN_UP


def _possible(effect: str, fit: Fit) -> bool:
    numbers = parameters_of(effect, fit)
    for spec in EFFECTS[effect].parameters:
        value = numbers[spec.name][0] if spec.name in numbers else spec.typical
        if not spec.lower <= value <= spec.upper:
            return False
    leading = EFFECTS[effect].parameters[0]
    return leading.name not in numbers or numbers[leading.name][0] != leading.lower


def _sound(effect: str, fit: Fit) -> bool:
    leading = EFFECTS[effect].parameters[0]
    size, _ = parameters_of(effect, fit).get(leading.name, (np.inf, None))
    return bool(abs(size) < leading.sound)


def _gains(pool: Pool, allowed: Collection[str]) -> dict[str, float]:
    """Effect → nats that its columns gain alone."""
    empty = pool.found[pool.emptiest].log_mass
    return {name: pool.alone(name) - empty for name in sorted(allowed)}


def _rivals(pool: Pool, allowed: Collection[str]) -> list[str]:
    """Effects whose columns change with size, and that promise to explain alone what the best set explains."""
    best_nats = pool.found[pool.best].log_mass - pool.found[pool.emptiest].log_mass
    least = max(constants.PROMISING, constants.HOPELESS * best_nats)
    return [name for name, gain in _gains(pool, allowed).items() if gain > least and refit_module(name) is not None]


def _shown(fit: Fit, allowed: Collection[str]) -> list[str]:
    """Effects that the events show next to those of a fit, whatever columns promise."""
    return [name for name in sorted(allowed) if shown_by_traces(fit, name) > constants.PROMISING]


def _promising(pool: Pool, fits: dict[Names, Fit], allowed: Collection[str]) -> list[str]:
    """Effects to try, by columns or single edges."""
    gain = _gains(pool, allowed)
    order = sorted((n for n in gain if gain[n] > constants.PROMISING), key=lambda n: -gain[n])[:PROPOSED]
    return list(dict.fromkeys((*order, *_seen_in_edges(fits, allowed))))


def _seen_in_edges(fits: dict[Names, Fit], allowed: Collection[str]) -> list[str]:
    base = next(iter(fits.values()))
    return [name for name in sorted(allowed) if shown_by_edges(base, name)]


def _with_one_less(
    session: Session, pool: Pool, fits: dict[Names, Fit], sets: Collection[Names], tried: set[tuple[Names, str]]
) -> dict[Names, Fit]:
    """Refits of sets without one effect each, and of that one after the others, of which it may have stood in for some:
    they hid its setting."""
    out: dict[Names, Fit] = {}
    base = next(iter(fits.values()))
    for wanted, name in [(each, name) for each in dict.fromkeys(sets) if each in fits for name in each]:
        fewer = tuple(other for other in wanted if other != name)
        if not fewer:
            continue
        if fewer not in fits | out:
            out |= grown(session, fits | out, pool, fewer, tried)
        known = fits | out
        if refit_module(name) is not None and fewer in known and (fewer, name) not in tried:
            tried.add((fewer, name))
            again = refits_with(session, known[fewer], name, _setting_alone(pool, name))
            best = likeliest([known[wanted], *again], base, name)
            if best is not None and best is not known[wanted]:
                out[wanted] = best
    return out


def _setting_alone(pool: Pool, name: str) -> tuple[float, ...]:
    return pool.settings_of(tuple(sorted({*pool.emptiest, name}))).get(name, ())


def _proposed(
    session: Session,
    pool: Pool,
    fits: dict[Names, Fit],
    options: Collection[str],
    starts: tuple[Names, ...],
    tried: set[tuple[Names, str]],
) -> dict[Names, Fit]:
    """Refits of each start with one more effect. tried: pairs not to be tried again, added to."""
    base = next(iter(fits.values()))
    out: dict[Names, Fit] = {}
    for name in options:
        for others in dict.fromkeys(starts):
            names = tuple(sorted({*others, name}))
            known = name in others or names in fits or names in out or (others, name) in tried
            if known or others not in fits:
                continue
            tried.add((others, name))
            fit = likeliest(refits_with(session, fits[others], name, _setting_alone(pool, name)), base, name)
            if fit is not None and not _loses(fit, fits[others]):
                out[names] = fit
    return out
