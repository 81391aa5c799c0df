"""Two names at once: effects that hide each other, so that neither alone shrinks the gap."""

from __future__ import annotations

from collections.abc import Collection
from itertools import combinations

import numpy as np

from draglag.gap.finding.scan import Candidate, Finding
from draglag.gap.fitting.heldout import gap_mm, improves
from draglag.gap.fitting.joint import Fit
from draglag.gap.fitting.signatures import SIGNATURES
from draglag.gap.fitting.state import Term
from draglag.gap.naming.choice import UNNAMED_MARGIN, Name
from draglag.gap.naming.refits import MODE, gained, possible, refit
from draglag.recording import FloatArray, Session
from draglag.simulation.effects import EFFECTS

TRIED = 3  # pairs refitted, of all those that a linear look ranks
EACH = 20.0  # deviance that either has to save beside the other


def name_two(
    session: Session, before: Fit, finding: Finding, candidates: Collection[str], plateau: bool, at_least: float
) -> tuple[Name, Name] | None:
    """The best pair of effects that saves more than ``at_least`` and of which each is needed beside the other.

    The first name is the one that saves more alone; its fit has it alone, the second's has both.
    """
    pairs = _ranked(before, finding, candidates)[:TRIED]
    best: tuple[float, Candidate, Candidate, Fit] | None = None
    for one, two in pairs:
        fit = refit(session, before, [*before.terms, _term(one), _term(two)], plateau)
        if fit is None or not (possible(str(one.effect), fit) and possible(str(two.effect), fit)):
            continue
        gain = _priced(before, fit, one, two)
        if gain > (at_least + UNNAMED_MARGIN if best is None else best[0]) and improves(before, fit):
            best = gain, one, two, fit
    if best is None:
        return None
    gain, one, two, both = best
    singles = {c: refit(session, before, [*before.terms, _term(c)], plateau) for c in (one, two)}
    gains = {c: -1e9 if fit is None else _priced(before, fit, c) for c, fit in singles.items()}
    first, second = sorted((one, two), key=lambda c: -gains[c])
    start = singles[first]
    if start is None or gain - gains[first] < EACH:
        return None
    before_mm, between_mm = gap_mm(before), gap_mm(start)
    return (
        Name(str(first.effect), start, gains[first], before_mm, between_mm, True),
        Name(str(second.effect), both, gain - gains[first], between_mm, gap_mm(both), True),
    )


def _term(candidate: Candidate) -> Term:
    return Term(str(candidate.effect), candidate.theta)


def _priced(before: Fit, after: Fit, *names: Candidate) -> float:
    return gained(before, after) - sum(c.gain - c.score for c in names)


def _ranked(fit: Fit, finding: Finding, allowed: Collection[str]) -> list[tuple[Candidate, Candidate]]:
    """Pairs of effects by what both together gain on the white residual, each at the setting found for it alone."""
    items = [c for c in finding.candidates if c.effect in SIGNATURES and c.effect in allowed and c.effect != MODE]
    white = fit.whiteners[fit.best]
    model = np.vstack([white.apply(fit.design), np.diag(np.sqrt(fit.prior))])
    q, _ = np.linalg.qr(model)
    own = q[: fit.residual_mm.size]

    def apart(values: FloatArray) -> FloatArray:
        out = white.apply(values)
        return np.asarray(out - own @ (own.T @ out))

    left = apart(fit.residual_mm)
    columns = {c: apart(EFFECTS[str(c.effect)].signature_at(c.theta, fit.view).columns(fit.view)) for c in items}

    def gain(pair: tuple[Candidate, Candidate]) -> float:
        both = np.hstack([columns[c] for c in pair])
        size = np.linalg.lstsq(both, left, rcond=1e-6)[0]
        return float(left @ both @ size) - sum(c.gain - c.score for c in pair)

    return sorted(combinations(items, 2), key=gain, reverse=True)
