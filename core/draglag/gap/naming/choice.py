"""Name: which library effect explains a finding best, refitted jointly and judged on held-out runs."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from draglag.gap.finding.scan import Candidate, Finding
from draglag.gap.fitting.heldout import clearly_less, gap_mm, improves, shrinks, shrinks_with
from draglag.gap.fitting.joint import Fit
from draglag.gap.fitting.parameters import parameters_of
from draglag.gap.fitting.signatures import unnamed_columns
from draglag.gap.fitting.state import FOLLOW_ACCELERATION, Term
from draglag.gap.naming.refits import HOPELESS, MODE, RARE, SETTLING, SMOOTHING, gained, possible, refit
from draglag.gap.naming.switching import settled
from draglag.gap.naming.tries import judged_by, refitted, tries, without_mixed
from draglag.recording import Session
from draglag.simulation.effects.acceleration_lag import WINDOWS_S

TOO_CLOSE = 6.0  # units of deviance within which two names cannot be told apart
UNNAMED_MARGIN = 8.0  # units by which a smooth term must beat every named effect
NEARLY = 0.05  # of the best gain: names so close are told apart by the gap on held-out runs
HALF = 0.5  # of the best gain, that a name must have to be looked at closer: a low-pass in its own form
BESIDE_UNNAMED = 0.5  # of a smooth term's gain: it may be the sum of two names
SETTLED = 0.03  # of a low-pass's time constant: what is left of it beside its setting is told to first order
SURELY_SMOOTH = 50.0  # gain of a low-pass that does not show in the gap
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
        # Quick circles tell one kind from another: all edges together, not run by run.
        other = _sharpened(session, before, name, name.fit, kind, plateau)
        found = other if other is not None and clearly_less(other.gap_after_mm, found.gap_after_mm) else found
    for _ in range(SETTLING):
        (lag_s, *_), term = parameters_of(SMOOTHING, found.fit)["time_constant_s"], found.fit.terms[-1]
        if not term.theta or abs(lag_s - term.theta[0]) < SETTLED * lag_s:
            break
        other = _sharpened(session, before, name, found.fit, term.theta[1:], plateau)
        if other is None or other.gap_after_mm > found.gap_after_mm:
            break
        found = other
    return found


def _sharpened(
    session: Session, before: Fit, name: Name, fit: Fit, kind: tuple[float, ...], plateau: bool
) -> Name | None:
    """The low-pass of ``fit``, undone in the traces as one of a kind, where held-out runs speak for that."""
    lag_s = parameters_of(SMOOTHING, fit)["time_constant_s"][0]
    undone = refit(session, before, [*before.terms, Term(SMOOTHING, (lag_s, *kind), (0.0,))], plateau, fit.law)
    if undone is None or not possible(SMOOTHING, undone) or not shrinks(name.fit, undone):
        return None
    gain = max(name.gain, name.gain + gained(name.fit, undone))
    return Name(SMOOTHING, undone, gain, name.gap_before_mm, gap_mm(undone), improves(before, undone))


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
        other = refit(session, before, terms, plateau, fit.law, fit.only)
        if other is not None and clearly_less(gap_mm(other), gap_mm(best)):
            best = other
    return best


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
        anew = refit(session, first, terms, plateau, fit.law, judged_by(fit.placed, terms))
        if anew is None:
            break
        fit = anew
        if clearly_less(gap_mm(fit), gap_mm(best.fit)):
            best = replace(name, fit=fit, gap_after_mm=gap_mm(fit))
    fit = without_mixed(session, first, best.fit, plateau)
    return best if fit is best.fit else replace(name, fit=fit, gap_after_mm=gap_mm(fit))


def name(
    session: Session, before: Fit, finding: Finding, candidates: Collection[str], plateau: bool
) -> tuple[list[Name], Candidate | None]:
    """Names best first, and the smooth term that beats them all (or None).

    Every significant library effect among the best few, the plateau wherever it promises anything (as a change of the
    law it has no column to be found by), and a law that follows another moment's speed wherever its mean effect hints
    at it, is refitted jointly with the rest of the model, but for those hopeless beside a sure name.
    """
    jump = sure_jump(before, finding)
    if jump is not None:
        return [], jump
    nameless = [c for c in finding.significant if c.effect is None]
    unnamed = next(
        (c for c in nameless if shrinks_with(before, unnamed_columns(before.view, c.covariate, c.role, c.theta))), None
    )
    before_mm = gap_mm(before)
    names: list[Name] = []
    sure = 0.0 if unnamed is None else BESIDE_UNNAMED * unnamed.score
    for a in tries(before, finding, candidates, plateau):
        if a.promised < HOPELESS * sure:
            continue
        fit = refitted(session, before, finding, plateau, sure, a)
        if fit is None or not possible(a.effect, fit):
            continue
        gain = gained(before, fit) - 6 * a.n_columns - 2 * np.log(a.n_grid)
        names.append(Name(a.effect, fit, float(gain), before_mm, gap_mm(fit), improves(before, fit)))
        if names[-1].improves:
            sure = max(sure, names[-1].gain)
    names.sort(key=lambda n: -n.gain)
    for k, one in enumerate(names):
        # Its mean effect leaves of quick circles what stand-ins explain: it is weighed as the low-pass that it is.
        if one.effect == SMOOTHING and one.gain > HALF * names[0].gain:
            one = with_the_trace_sharpened(session, before, one, plateau)
            # The position fits bend circles a little, tremor with them: that would not show in the gap.
            names[k] = replace(one, improves=one.improves and (one.gain > SURELY_SMOOTH or shrinks(before, one.fit)))
        elif one.effect == "acceleration_lag" and one.gain > HALF * names[0].gain:
            fit = in_the_best_window(session, before, one.fit, plateau)
            gain = one.gain + gained(one.fit, fit)
            names[k] = replace(one, fit=fit, gain=gain, gap_after_mm=gap_mm(fit), improves=improves(before, fit))
    # Where likelihoods all but agree, the name that closes the gap on held-out runs is the better one. Those of what
    # follows the acceleration hold a scatter of their own, and say less.
    near = [
        n
        for n in names
        if n.gain > names[0].gain - max(10.0, NEARLY * names[0].gain)
        or n.effect == names[0].effect  # in two forms, which leave other edges unjudged
        or ({n.effect, names[0].effect} <= set(FOLLOW_ACCELERATION) and n.gain > HALF * names[0].gain)
    ]
    names.sort(key=lambda n: (n not in near, n.gap_after_mm if n in near else 0.0, -n.gain))
    names = [n for k, n in enumerate(names) if all(n.effect != better.effect for better in names[:k])]
    # Beside a significant finding a name has to be worth its price; alone the plateau has to be as rare as a finding.
    least = 0.0 if finding.significant else RARE
    names = [n for n in names if n.gain > least and n.improves]
    best = names[0].gain if names else 0.0
    if unnamed is not None and unnamed.score > best + UNNAMED_MARGIN:  # nothing at all has a gain of 0
        return names, unnamed
    return names, None
