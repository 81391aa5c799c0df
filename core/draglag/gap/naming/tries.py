"""Which names are worth a joint refit beside a finding, and where each refit begins."""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from draglag.errors import EstimateError
from draglag.gap.finding.scan import Finding
from draglag.gap.fitting.joint import RIPPLE, Fit, fit_session, latency_of_terms, most_promising
from draglag.gap.fitting.plateau import promised_gain
from draglag.gap.fitting.signatures import SIGNATURES
from draglag.gap.fitting.state import LAGGING, Term
from draglag.gap.naming.delayed import OTHER, delayed
from draglag.gap.naming.refits import MODE, PLATEAU, RARE, SETTLING, SMALLEST, refit
from draglag.gap.naming.stepped import Step, find_step
from draglag.gap.naming.switching import (
    EACH_SWITCH,
    LEAST_EDGES,
    Switching,
    away,
    beyond_both,
    find_switching,
    later_of,
    law_beside,
    mistaken_s,
    of_neither,
    settled,
)
from draglag.gap.streams.lattice import Lattice
from draglag.gap.traces.edges import Placed
from draglag.gap.traces.run_data import as_shown, lattice_in
from draglag.gap.traces.skips import Skips, find_skips
from draglag.recording import Session
from draglag.simulation.effects import EFFECTS
from draglag.simulation.effects.acceleration_lag import LAGS_S3_MM, WINDOWS_S

REFITTED = 6
LEFT_OVER = 0.03  # of a lateness undone: what is left is told to first order
AGREE = 0.15  # of the lateness that skips show: five times what they know it by
BESIDE = np.geomspace(0.9, 1.1, 9)  # of a speed found among quantiles
END_S = 0.3  # of a trace; three times what an acceleration behind it remembers
SURE_SIZE = 3.0  # standard deviations
HINTED = 5.0  # gain of a lagging law's mean effect, below which it is not looked for: most sound sessions
HINTS = 5.0  # times that gain is what the law itself may come to; 1 to 3 times is usual


@dataclass(frozen=True)
class Try:
    """A name to be refitted. promised: what it gains as far as that is known before; n_columns, n_grid: its price."""

    effect: str
    theta: tuple[float, ...]
    n_columns: int
    n_grid: int
    promised: float
    found: Step | Switching | Skips | None = None


def tries(before: Fit, finding: Finding, candidates: Collection[str], plateau: bool) -> list[Try]:
    """The effects worth a refit, the likeliest first where that is known."""
    significant = [c for c in finding.significant if c.effect in SIGNATURES and c.effect in candidates]
    out = [Try(c.effect, c.theta, c.n_columns, c.n_grid, c.score) for c in significant[:REFITTED] if c.effect]
    new = {e for e in candidates if all(t.effect != e for t in before.terms)}
    step = find_step(before.runs, latency_of_terms(before)) if MODE in new and not plateau else None
    switching = find_switching(before) if MODE in new and finding.significant else None
    mode = next((t for t in out if t.effect == MODE), None)
    if step is not None:
        by_speed, promised = ((), 0.0) if mode is None or mode.theta[1] else (mode.theta, mode.promised)
        mode = Try(MODE, by_speed, 1, 32, max(step.gain, promised), step)
    if switching is not None and switching.gain > RARE:
        n_columns = 1 + round(EACH_SWITCH / 6 * len(switching.on_s) * 2)
        mode = Try(MODE, switching.theta, n_columns, 1, switching.gain, switching)
    if mode is not None:
        out = [*(t for t in out if t.effect != MODE), mode]
    skips = find_skips(as_shown(before.runs)) if MODE in new else None
    if skips is not None:
        # Touch events show switches, and not of what: a filter by speed is refitted beside one that comes and goes.
        out = [replace(t, promised=np.inf) if t.effect == MODE else t for t in out]
        out.insert(0, Try(MODE, skips.theta, 1, 1, np.inf, skips))
    if PLATEAU in candidates and not plateau:
        promised = promised_gain(before)
        out += [Try(PLATEAU, (), 1, 8, promised)] if promised > 0 else []
    out = [t for t in out if t.effect != LAGGING]
    hint = max((c.gain for c in finding.candidates if c.effect == LAGGING), default=0.0)
    if LAGGING in candidates and hint > HINTED:
        out.append(Try(LAGGING, (), 1, len(OTHER), HINTS * hint))
    if RIPPLE in new and all(t.effect != RIPPLE for t in out):
        lattice = shown_ripple(before)
        out += [Try(RIPPLE, (lattice.pitch_mm, 1.0), 4, 1, np.inf)] if lattice is not None else []
    return out


def refitted(session: Session, before: Fit, finding: Finding, plateau: bool, sure: float, a: Try) -> Fit | None:
    """The joint refit with a name, begun where that name asks for it."""
    if a.effect == PLATEAU:
        return refit(session, before, before.terms, True)
    if a.effect == LAGGING:
        return delayed(session, before, finding, plateau, sure)
    if isinstance(a.found, Switching):
        return _switched(session, before, a.found, plateau)
    if isinstance(a.found, Skips):
        return _skipping(session, before, a.found, plateau)
    if isinstance(a.found, Step) or (a.effect == MODE and not a.theta[1]):
        return _above_a_speed(session, before, plateau, a)
    if a.effect == "acceleration_lag":
        options = [[*before.terms, Term(a.effect, (lag, WINDOWS_S[0]), (lag,))] for lag in LAGS_S3_MM]
        terms = most_promising(before, options, before.law)
        return refit(session, before, terms, plateau, only=judged_by(before.placed, terms[-1:]))
    return refit(session, before, [*before.terms, Term(a.effect, a.theta)], plateau)


def judged_by(placed: Placed, terms: Sequence[Term]) -> np.ndarray:
    """Edges (m,) that a model with these terms can judge by: none about a switch of a second filter, and none about a
    trace's ends where the acceleration behind the trace counts, which is told from what comes before and after."""
    out = np.ones(len(placed), bool)
    for term in terms:
        if term.effect == MODE:
            out &= away(placed, term.theta, term.sizes[0])
        elif term.effect == "acceleration_lag":
            at_s = placed.t_s + placed.latency_s
            ends_s = np.array([(data.t_s[0], data.t_s[-1]) for data in placed.traces.runs])[placed.run]
            out &= (at_s > ends_s[:, 0] + END_S) & (at_s < ends_s[:, 1] - END_S)
    return out


def fit_judged(session: Session, before: Fit, terms: Sequence[Term], plateau: bool) -> Fit:
    """The joint fit with terms that are not sized yet, by the edges that it can be judged by. Raises as fit_session."""
    fit = fit_session(session, before.runs, terms, plateau, before)
    only = judged_by(fit.placed, fit.terms)
    return fit if only.all() else fit_session(session, before.runs, fit.terms, plateau, before, fit.law, only)


def shown_ripple(fit: Fit) -> Lattice | None:
    """The lattice that the touch events show, if large enough for a name, however little of it the edges show."""
    lattice = lattice_in(as_shown(fit.runs))
    least_mm = SMALLEST[RIPPLE] * EFFECTS[RIPPLE].parameters[0].typical
    return None if lattice is None or float(np.abs(lattice.sizes_mm).max()) < least_mm else lattice


def _above_a_speed(session: Session, before: Fit, plateau: bool, a: Try) -> Fit | None:
    """A filter that takes over above the likeliest speed: next to the one that single edges show, or between the two
    runs whose latencies part; beside it no edge is of one filter alone."""
    law, speeds = before.law, [v * a.theta[0] for v in BESIDE] if a.theta else []
    if isinstance(a.found, Step):
        law, speeds = a.found.law, [*speeds, *a.found.thresholds_mm_s()]
    size_s = a.found.size_s if isinstance(a.found, Step) else EFFECTS[MODE].parameters[0].typical
    options = [[*before.terms, Term(MODE, (float(v), 0.0), (size_s,))] for v in speeds]
    terms = most_promising(before, options, law)
    fit = refit(session, before, terms, plateau, law, away(before.placed, terms[-1].theta, size_s))
    if fit is None:
        return None
    size_s = fit.terms[-1].sizes[0]
    by_chance = abs(size_s) < SURE_SIZE * float(np.sqrt(fit.covariance[-1, -1]))  # the edges left out made it likely
    return None if by_chance or beyond_both(fit, fit.terms[-1].theta[0], size_s) else fit


def _switched(session: Session, before: Fit, switching: Switching, plateau: bool) -> Fit | None:
    """The fit with a filter that comes and goes, its times settled beside the law."""
    fit, law, theta, size_s = None, None, switching.theta, switching.size_s
    for _ in range(SETTLING):
        only = away(before.placed, theta, size_s)
        fit = refit(session, before, [*before.terms, Term(MODE, theta, (size_s,))], plateau, law, only)
        if fit is None:
            return None
        size_s, last = fit.terms[-1].sizes[0], theta
        theta = settled(fit, size_s, theta)
        if (theta == last and law is not None) or len(theta) < 4:
            break
        with contextlib.suppress(EstimateError):
            law = law_beside(fit, plateau)
    return None if fit is None else without_mixed(session, before, fit, plateau)


def without_mixed(session: Session, first: Fit, fit: Fit, plateau: bool) -> Fit:
    """A fit with a filter that comes and goes, without the edges next to a switch that show a mean of both filters.
    first: a fit whose edges all count."""
    mode = next(t for t in fit.terms if t.effect == MODE)
    mixed = of_neither(fit, mode.theta)
    if not mixed.any():
        return fit
    only = judged_by(first.placed, fit.terms) & ~mixed
    return refit(session, first, fit.terms, plateau, fit.law, only) or fit


def _skipping(session: Session, before: Fit, skips: Skips, plateau: bool) -> Fit | None:
    """The fit with a second filter undone in the traces, where they show it; what is left of its lateness is fitted,
    and undone again until little is. None where edges ask for another lateness than the traces show: that is no filter
    with two levels."""
    fit, theta = None, skips.theta
    for _ in range(SETTLING):
        law, last = (None, before) if fit is None else (fit.law, fit)
        only = away(last.placed, theta, theta[0])
        later = later_of(last.placed, theta)
        if np.count_nonzero(only & later & before.use) < LEAST_EDGES:
            only &= ~later  # the lateness is what skips show
        found = refit(session, before, [*before.terms, Term(MODE, theta, (0.0,))], plateau, law, only)
        if found is None:
            return fit
        fit, left_s, mistaken = found, found.terms[-1].sizes[0], mistaken_s(found, theta)
        if abs(left_s) < LEFT_OVER * theta[0] and not mistaken:
            break
        # In a stretch of a stretch the filter has let go again; as long as some are mistaken, they make the size.
        theta = (theta[0] if mistaken else theta[0] + left_s, *theta[1:2], *sorted((*theta[2:], *mistaken)))
    size_s = 0.0 if fit is None else fit.terms[-1].theta[0] + fit.terms[-1].sizes[0]
    return fit if abs(size_s - skips.size_s) < AGREE * skips.size_s else None
