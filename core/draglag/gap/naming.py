"""Name: which library effect explains a finding best, refitted jointly and judged on held-out runs."""

from __future__ import annotations

import contextlib
from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from draglag.errors import EstimateError
from draglag.gap.delayed import OTHER, delayed
from draglag.gap.finding import Candidate, Finding
from draglag.gap.fit import RIPPLE, Fit, latency_of_terms, most_promising
from draglag.gap.heldout import clearly_less, gap_mm, improves, shrinks, shrinks_with
from draglag.gap.lattice import Lattice
from draglag.gap.parameters import parameters_of
from draglag.gap.plateau import promised_gain
from draglag.gap.refits import HOPELESS, MODE, PLATEAU, RARE, SMALLEST, SMOOTHING, gained, possible, refit
from draglag.gap.run_data import as_shown, lattice_in
from draglag.gap.signatures import SIGNATURES, unnamed_columns
from draglag.gap.state import FOLLOW_ACCELERATION, LAGGING, Term
from draglag.gap.stepped import find_step
from draglag.gap.switching import EACH_SWITCH, Switching, away, find_switching, law_beside, settled
from draglag.recording import Session
from draglag.simulation.effects import EFFECTS
from draglag.simulation.effects.acceleration_lag import LAGS_S3_MM, WINDOWS_S

TOO_CLOSE = 6.0  # units of deviance within which two names cannot be told apart
UNNAMED_MARGIN = 8.0  # units by which a smooth term must beat every named effect
REFITTED = 6
NEARLY = 0.05  # of the best gain: names so close are told apart by the gap on held-out runs
HALF = 0.5  # of the best gain, that a low-pass's mean effect must have to be weighed in its own form
SETTLING, SETTLED = 4, 0.01
SURELY_SMOOTH = 50.0  # gain of a low-pass that does not show in the gap
HINTED = 5.0  # gain of a lagging law's mean effect, below which it is not looked for: most sound sessions
JUMP_SURE, JUMP_LEAST = 1.2, 100.0


@dataclass(frozen=True)
class Name:
    """One candidate name after its joint refit. gain: penalised deviance it saves."""

    effect: str
    fit: Fit
    gain: float
    gap_before_mm: float
    gap_after_mm: float
    improves: bool


def with_the_trace_sharpened(session: Session, before: Fit, name: Name, plateau: bool) -> Name:
    """A low-pass undone in the traces, tremor and quick circles too, where that closes more than its mean effect."""
    found = name
    for kind in ((), (1.0,)):
        fit = name.fit
        for _ in range(SETTLING):
            lag_s = parameters_of(SMOOTHING, fit)["time_constant_s"][0]
            setting = next(t.theta for t in fit.terms if t.effect == SMOOTHING)
            if setting and abs(lag_s - setting[0]) < SETTLED * lag_s:
                break
            terms = [Term(SMOOTHING, (lag_s, *kind), (0.0,)) if t.effect == SMOOTHING else t for t in fit.terms]
            better = refit(session, before, terms, plateau, fit.law)
            if better is None or not possible(SMOOTHING, better):
                break
            fit = better
            # Quick circles tell one kind from another: all edges together, not run by run.
            if shrinks(name.fit, fit) and clearly_less(gap_mm(fit), gap_mm(found.fit)):
                gain = max(name.gain, name.gain + gained(name.fit, fit))
                found = Name(SMOOTHING, fit, gain, name.gap_before_mm, gap_mm(fit), improves(before, fit))
    return found


def in_the_best_window(session: Session, before: Fit, fit: Fit, plateau: bool) -> Fit:
    """The acceleration smoothed as closes the gap best."""
    *others, term = fit.terms
    if term.theta[0] <= 0:
        return fit
    best = fit
    for window_s in WINDOWS_S:
        if window_s == term.theta[1]:
            continue
        terms = [*others, replace(term, theta=(term.theta[0], window_s))]
        other = refit(session, before, terms, plateau, fit.law)
        if other is not None and clearly_less(gap_mm(other), gap_mm(best)):
            best = other
    return best


def shown_ripple(fit: Fit) -> Lattice | None:
    """The lattice that the touch events show, if large enough for a name, however little of it the edges show."""
    lattice = lattice_in(as_shown(fit.runs))
    least_mm = SMALLEST[RIPPLE] * EFFECTS[RIPPLE].parameters[0].typical
    return None if lattice is None or float(np.abs(lattice.sizes_mm).max()) < least_mm else lattice


def sure_jump(fit: Fit, finding: Finding) -> Candidate | None:
    """A jump along the panel that explains clearly more than any effect or smooth term: no refit will change that.

    One in time is weighed against refits: by the order of runs it may stand for an effect that follows their speed.
    """
    best, *others = finding.candidates[:1] + tuple(c for c in finding.candidates[1:] if not _is_jump(c))
    if not (_is_jump(best) and best.covariate == "x" and best in finding.significant):
        return None
    if best.score < JUMP_SURE * max((c.score for c in others), default=0.0) or best.score < JUMP_LEAST:
        return None
    return best if shrinks_with(fit, unnamed_columns(fit.view, best.covariate, best.role, best.theta)) else None


def _is_jump(candidate: Candidate) -> bool:
    return candidate.effect is None and candidate.role.endswith("jump")


def _switched(session: Session, before: Fit, switching: Switching, plateau: bool) -> Fit | None:
    """The fit with a filter that comes and goes, its times settled beside the law."""
    fit, law, theta, size_s = None, None, switching.theta, switching.size_s
    for _ in range(SETTLING):
        only = away(before.placed.since_start_s, theta)
        fit = refit(session, before, [*before.terms, Term(MODE, theta, (size_s,))], plateau, law, only)
        if fit is None:
            return None
        size_s, last = fit.terms[-1].sizes[0], theta
        theta = settled(fit, size_s, theta)
        if (theta == last and law is not None) or len(theta) < 4:
            break
        with contextlib.suppress(EstimateError):
            law = law_beside(fit, plateau)
    return fit


def with_times_anew(session: Session, first: Fit, name: Name, plateau: bool) -> Name:
    """Beside a filter named before that comes and goes: its times looked for again beside what was added, where that
    closes more. Another effect of the same size hides them. first: the fit without effects, whose edges all count."""
    mode = next((t for t in name.fit.terms if t.effect == MODE and t.theta[1:2] == (2.0,)), None)
    if mode is None or name.effect == MODE or first.use.size != name.fit.use.size:
        return name
    fit, best, theta = name.fit, name, mode.theta
    for _ in range(SETTLING):
        size_s, last = next(t.sizes[0] for t in fit.terms if t.effect == MODE), theta
        theta = settled(fit, size_s, theta)
        if theta == last or len(theta) < 4:
            break
        terms = [Term(MODE, theta, (size_s,)) if t.effect == MODE else t for t in fit.terms]
        anew = refit(session, first, terms, plateau, fit.law, away(fit.placed.since_start_s, theta))
        if anew is None:
            break
        fit = anew
        if clearly_less(gap_mm(fit), gap_mm(best.fit)):
            best = replace(name, fit=fit, gap_after_mm=gap_mm(fit))
    return best


def name(
    session: Session, before: Fit, finding: Finding, candidates: Collection[str], plateau: bool
) -> tuple[list[Name], Candidate | None]:
    """Names best first, and the smooth term that beats them all (or None).

    Every significant library effect among the best few, the plateau wherever it promises anything (as a change of the
    law it has no column to be found by), and a law that follows another moment's speed wherever its mean effect hints
    at it, is refitted jointly with the rest of the model, but for those hopeless beside a sure name.
    """
    significant = [c for c in finding.significant if c.effect in SIGNATURES and c.effect in candidates]
    jump = sure_jump(before, finding)
    if jump is not None:
        return [], jump
    tries = [(c.effect, c.theta, c.n_columns, c.n_grid) for c in significant[:REFITTED] if c.effect]
    scores = {c.effect: c.score for c in significant}
    step = None
    if MODE in candidates and not plateau and all(t.effect != MODE for t in before.terms):
        step = find_step(before.runs, latency_of_terms(before))
    if step is not None:
        tries = [t for t in tries if t[0] != MODE] + [(MODE, (), 1, 32)]
    switching = None
    if MODE in candidates and all(t.effect != MODE for t in before.terms) and finding.significant:
        switching = find_switching(before)
    if switching is not None and switching.gain > RARE:
        tries = [t for t in tries if t[0] != MODE] + [(MODE, switching.theta, 1, 1)]
    if PLATEAU in candidates and not plateau and promised_gain(before) > 0:
        tries.append((PLATEAU, (), 1, 8))
    tries = [t for t in tries if t[0] != LAGGING]
    if LAGGING in candidates and any(c.effect == LAGGING and c.gain > HINTED for c in finding.candidates):
        tries.append((LAGGING, (), 1, len(OTHER)))
    if RIPPLE in candidates and all(t[0] != RIPPLE for t in tries) and all(t.effect != RIPPLE for t in before.terms):
        lattice = shown_ripple(before)
        if lattice is not None:
            tries.append((RIPPLE, (lattice.pitch_mm, 1.0), 4, 1))
            scores[RIPPLE] = np.inf
    before_mm = gap_mm(before)
    names = []
    sure = 0.0
    for effect, theta, n_columns, n_grid in tries:
        if effect not in (MODE, PLATEAU, LAGGING) and scores[effect] < HOPELESS * sure:
            continue
        if effect == PLATEAU:
            fit = refit(session, before, before.terms, True)
        elif effect == LAGGING:
            fit = delayed(session, before, finding, plateau, sure)
        elif effect == MODE and switching is not None and theta == switching.theta:
            fit = _switched(session, before, switching, plateau)
            n_columns += round(EACH_SWITCH / 6 * len(switching.on_s) * 2)
        elif effect == MODE and step is not None:
            thresholds = [(float(v), 0.0) for v in step.thresholds_mm_s()]
            options = [[*before.terms, Term(effect, at, (step.size_s,))] for at in thresholds]
            fit = refit(session, before, most_promising(before, options, step.law), plateau, step.law)
        elif effect == "acceleration_lag":
            options = [[*before.terms, Term(effect, (lag, WINDOWS_S[0]), (lag,))] for lag in LAGS_S3_MM]
            fit = refit(session, before, most_promising(before, options, before.law), plateau)
            fit = fit and in_the_best_window(session, before, fit, plateau)
        else:
            fit = refit(session, before, [*before.terms, Term(effect, theta)], plateau)
        if fit is None:
            continue
        if not possible(effect, fit):
            continue
        gain = gained(before, fit) - 6 * n_columns - 2 * np.log(n_grid)
        names.append(Name(effect, fit, float(gain), before_mm, gap_mm(fit), improves(before, fit)))
        if names[-1].improves:
            sure = max(sure, names[-1].gain)
    names.sort(key=lambda n: -n.gain)
    for k, one in enumerate(names):
        # Its mean effect leaves of quick circles what stand-ins explain: it is weighed as the low-pass that it is.
        if one.effect == SMOOTHING and one.gain > HALF * names[0].gain:
            one = with_the_trace_sharpened(session, before, one, plateau)
            # The position fits bend circles a little, tremor with them: that would not show in the gap.
            names[k] = replace(one, improves=one.improves and (one.gain > SURELY_SMOOTH or shrinks(before, one.fit)))
    # Where likelihoods all but agree, the name that closes the gap on held-out runs is the better one. Those of what
    # follows the acceleration hold a scatter of their own, and say less.
    near = [
        n
        for n in names
        if n.gain > names[0].gain - max(10.0, NEARLY * names[0].gain)
        or ({n.effect, names[0].effect} <= set(FOLLOW_ACCELERATION) and n.gain > HALF * names[0].gain)
    ]
    names.sort(key=lambda n: (n not in near, n.gap_after_mm if n in near else 0.0, -n.gain))
    # Beside a significant finding a name has to be worth its price; alone the plateau has to be as rare as a finding.
    least = 0.0 if finding.significant else RARE
    names = [n for n in names if n.gain > least and n.improves]
    nameless = [c for c in finding.significant if c.effect is None]
    unnamed = next(
        (c for c in nameless if shrinks_with(before, unnamed_columns(before.view, c.covariate, c.role, c.theta))), None
    )
    best = names[0].gain if names else 0.0
    if unnamed is not None and unnamed.score > best + UNNAMED_MARGIN:  # nothing at all has a gain of 0
        return names, unnamed
    return names, None
