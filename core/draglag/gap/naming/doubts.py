"""Second thoughts about a name: whether it holds beside the newest, whether taps speak against it, what is left."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from draglag.gap.finding.scan import Candidate, Finding, find
from draglag.gap.finding.separate import clock_offset
from draglag.gap.fitting.heldout import clearly_less, floor_mm, gap_mm, shrinks_with
from draglag.gap.fitting.joint import Fit
from draglag.gap.fitting.model import base_prior
from draglag.gap.fitting.noise import EDGE_MM, UNEVEN
from draglag.gap.fitting.parameters import parameters_of
from draglag.gap.fitting.signatures import SIGNATURES, unnamed_columns
from draglag.gap.fitting.state import Term
from draglag.gap.naming.choice import UNNAMED_MARGIN, Name, name
from draglag.gap.naming.refits import MODE, PLATEAU, gained, possible, refit
from draglag.gap.naming.tries import judged_by
from draglag.gap.results import PassedOver, Step
from draglag.recording import Session
from draglag.simulation.effects import column_of, effect_class

ESTIMATED = {"acceleration", "normal_acceleration"}  # known from smoothed traces only; held-out runs decide there
LEFT, LEFT_IN_SPEED = 0.3, 0.1  # of what a name explains
HARDLY, BARELY = 0.7, 0.9  # of the gap, that a step of the law, or all names, leave beside something without a name
SURE = 300.0  # deviance: twice what a ripple without a name lent to a beam width in a generated session (149)
DETAIL = 0.03
STRETCHED = 2.0
BEYOND_DOUBT = 1e-3
OTHERS = 2  # names beside the first that a smooth term may be the sum of
CERTAIN = 80.0  # a structure this strong is there, whatever the held-out runs make of it


def beside(steps: Iterable[str], ages: bool) -> set[str]:
    """Effects that cannot be told beside those named: their evidence is what these leave themselves."""
    out = set(steps)
    if "smoothing_shrink" in out:
        out.add("lagging_law")  # a low-pass delays, and the speed that counts with it
    if ages:
        out |= {"lagging_law", "acceleration_lag"}  # positions of uneven age beat with the motion
    return out


def left_out(allowed: frozenset[str]) -> set[str]:
    out = {e for e in SIGNATURES if e not in allowed}
    if "thermal_drift" in allowed:
        out.discard("clock_drift")  # they share one signature; taps decide on the name
    if "scale_error" in allowed:
        out.discard("beam_width")
    return out


def path_closes(session: Session, start: Name, allowed: frozenset[str], plateau: bool) -> bool:
    """Whether named effects, added one by one from a first, leave nothing: then a smooth term was only their sum."""
    fit, used = start.fit, {start.effect}
    plateau = plateau or start.effect == PLATEAU
    for _ in range(OTHERS):
        finding = find(fit, without=left_out(allowed) | used)
        if not finding.significant or (len(used) > 1 and still_there(fit, finding) is None):
            return True
        names, unnamed = name(session, fit, finding, allowed, plateau)
        if unnamed is not None or not names:
            return False
        fit = names[0].fit
        used.add(names[0].effect)
        plateau = plateau or names[0].effect == PLATEAU
    return still_there(fit, find(fit, without=left_out(allowed) | used)) is None


def without_term(session: Session, fit: Fit, effect: str, first: Fit) -> Fit | None:
    """The fit without one of its terms, by all edges of ``first`` that the other terms can be judged by: those that
    could only not be judged by beside it count again."""
    others = [term for term in fit.terms if term.effect != effect]
    plateau = fit.law.plateau_mm_s > 0
    if first.use.size != fit.use.size:
        return refit(session, fit, others, plateau, fit.law)
    return refit(session, first, others, plateau, fit.law, judged_by(first.placed, others))


def without_proxies(session: Session, fit: Fit, steps: list[Step], first: Fit) -> tuple[Fit, list[Step]]:
    """Look at earlier names again beside the newest: one that only stood in for it is dropped."""
    newest = column_of(steps[-1].effect) if steps else ""
    for term in [t for t in fit.terms if t.effect != newest]:
        at = [t.effect for t in fit.terms]
        others = [t for t in fit.terms if t.effect != term.effect]
        begin = base_prior(fit.law).size + sum(len(t.sizes) for t in fit.terms[: at.index(term.effect)])
        own = slice(begin, begin + len(term.sizes))
        sizes = np.array(term.sizes)
        wald = float(sizes @ np.linalg.pinv(fit.covariance[own, own]) @ sizes)
        too_small = not possible(term.effect, fit)
        if wald > 40 * sizes.size and not too_small:
            continue
        without = refit(session, fit, others, fit.law.plateau_mm_s > 0, fit.law)
        if without is None:
            continue
        if too_small or -gained(fit, without) < 8 * sizes.size:
            fit = without if fit.only is None else without_term(session, fit, term.effect, first) or without
            steps = [s for s in steps if column_of(s.effect) != term.effect]
    return fit, steps


def contradicted_by_taps(session: Session, fit: Fit, first: Fit) -> Fit | None:
    """The fit without its step of the law, if taps agree with the asymptote then and not beside it; else None.

    A step at some speed takes runs on its far side to another asymptote. Where taps deny that, a law bent otherwise
    was taken for a step.
    """
    if all(t.effect != MODE for t in fit.terms) or clock_offset(session, fit) is None:
        return None
    without = refit(session, fit, [t for t in fit.terms if t.effect != MODE], fit.law.plateau_mm_s > 0)
    if without is None or clock_offset(session, without) is not None:
        return None
    return without_term(session, fit, MODE, first) or without


def still_there(fit: Fit, finding: Finding) -> Candidate | None:
    """The strongest structure left that held-out runs confirm and that is worth more than its price."""
    for candidate in finding.significant:
        if candidate.score <= UNNAMED_MARGIN:
            return None
        if candidate.effect is None and candidate.score > CERTAIN and candidate.covariate not in ESTIMATED:
            return candidate
        if candidate.effect is not None:
            continue
        columns = unnamed_columns(fit.view, candidate.covariate, candidate.role, candidate.theta)
        if shrinks_with(fit, columns):
            return candidate
    return None


def a_detail(left: Candidate, steps: list[Step]) -> bool:
    """Whether what is left follows what a named effect follows and is next to nothing beside it: its exact shape."""
    return left.effect is None and any(
        effect_class(step.effect).follows == left.covariate and left.score < DETAIL * step.gain for step in steps
    )


def passed_over(session: Session, fit: Fit, finding: Finding, allowed: frozenset[str]) -> tuple[PassedOver, ...]:
    """What is significant in the last finding and yet has no name: the strongest two, with their size if they have one.

    A gap far below the noise of one edge can be beyond chance in thousands of edges; it is told, not named.
    """
    out = []
    for candidate in finding.significant[:2]:
        what = candidate.effect or candidate.covariate
        why = "it is worth less than the terms it takes or does not shrink the gap on held-out runs"
        if candidate.effect in SIGNATURES and candidate.effect in allowed:
            terms = [*fit.terms, Term(candidate.effect, candidate.theta)]
            after = refit(session, fit, terms, fit.law.plateau_mm_s > 0)
            if after is not None:
                sizes = parameters_of(candidate.effect, after)
                numbers = ", ".join(f"{key} {value:.3g} ({a:.3g} to {b:.3g})" for key, (value, (a, b)) in sizes.items())
                gaps = f"gap on held-out runs {gap_mm(fit):.3f} → {gap_mm(after):.3f} mm"
                why = f"{numbers}; {gaps}: too little for a name"
        out.append(PassedOver(what, candidate.p_value, why))
    return tuple(out)


def without_parts(
    steps: list[Step], fit: Fit, first: Fit, unexplained: Candidate, finding: Finding
) -> tuple[list[Step], Fit]:
    """Steps and fit before the first name that was only a part of what is left.

    A structure without a name that is large beside what a name explained had that name as its part. A step of the law
    that leaves much in the speed itself, or most of the gap, was a law bent otherwise. An effect of the acceleration
    that leaves edges scattered as widely as can be took the trace's own jumps for changes of speed.
    """
    left = max([unexplained.score, *(c.score for c in finding.significant if c.effect is None)])
    for k, step in enumerate(steps):
        bent_otherwise = step.effect == MODE and unexplained.covariate == "speed"
        share = LEFT_IN_SPEED if bent_otherwise else LEFT
        if step.fit is None:
            continue
        hardly = bent_otherwise and step.gap_after_mm > HARDLY * step.gap_before_mm
        scattered = step.fit.whiteners[step.fit.best].components.edge_mm >= max(EDGE_MM)
        if hardly or left > share * step.gain or (scattered and effect_class(step.effect).follows == "acceleration"):
            return _before(k, steps, first)
    return steps, fit


def without_idle(steps: list[Step], fit: Fit, first: Fit, left: Candidate) -> tuple[list[Step], Fit]:
    """Steps and fit without names that together close next to nothing, where something larger without a name is left:
    they took what lay nearest. What the streams show stays, and so do names surer than what is left, if they close
    anything."""
    fitted = [k for k, step in enumerate(steps) if step.fit is not None]
    if not fitted:
        return steps, fit
    before_mm, after_mm = steps[fitted[0]].gap_before_mm, steps[fitted[-1]].gap_after_mm
    sure = max(steps[k].gain for k in fitted) > max(left.score, SURE) and after_mm < before_mm
    if after_mm > BARELY * before_mm and not sure:
        return _before(fitted[0], steps, first)
    return steps, fit


def outweighed(steps: list[Step], finding: Finding) -> Candidate | None:
    """What is left without a name, where it is surer than every name and these together do not shrink the gap."""
    fitted = [step for step in steps if step.fit is not None]
    if not fitted or clearly_less(fitted[-1].gap_after_mm, fitted[0].gap_before_mm):
        return None
    most = max(step.gain for step in fitted)
    return next((c for c in finding.significant if c.effect is None and c.score > most), None)


def _before(k: int, steps: list[Step], first: Fit) -> tuple[list[Step], Fit]:
    return steps[:k], next((s.fit for s in reversed(steps[:k]) if s.fit is not None), first)


def strained(fit: Fit, finding: Finding) -> Candidate | None:
    """The strongest structure beyond chance where noise had to be stretched to hold what is left; else None.

    No sound session needs a law that its runs follow so unevenly, and none leaves a gap of twice its noise.
    """
    widest = fit.whiteners[fit.best].components.uneven >= max(UNEVEN)
    stretched = widest or gap_mm(fit) > STRETCHED * floor_mm(fit, granted=True)
    found = [c for c in finding.significant if c.p_value <= BEYOND_DOUBT] if stretched else []
    return next((c for c in found if c.effect is None), next(iter(found), None))


def covariate_of(candidate: Candidate) -> str:
    return candidate.covariate or effect_class(candidate.effect or "").follows or candidate.effect or ""
