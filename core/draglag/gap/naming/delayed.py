"""Whether the law follows the speed of another moment: looked for by asking it at that speed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from draglag.gap.finding.scan import Finding
from draglag.gap.fitting.heldout import gap_mm
from draglag.gap.fitting.joint import Fit
from draglag.gap.fitting.likelihood import profile
from draglag.gap.fitting.noise import scatter
from draglag.gap.fitting.parameters import parameters_of
from draglag.gap.fitting.state import FOLLOW_ACCELERATION, LAGGING, Term, look
from draglag.gap.fitting.whitening import Whitener, whitener
from draglag.gap.naming.refits import RARE, gained, possible, refit
from draglag.gap.traces.asked import NOW, Asked
from draglag.recording import FloatArray, Session
from draglag.simulation.effects.lagging_law import USUAL_LATENCY_S

# A digitiser reads its speed from its last positions: on sound panels the law's speed is up to this late.
USUAL: tuple[Asked, ...] = (NOW, (0.0, 0.015), (0.0, 0.025))
PAST_S = (0.035, 0.05, 0.07, 0.1, 0.15)
OTHER: tuple[Asked, ...] = (
    *((0.0, s) for s in PAST_S),
    (0.0, -0.035),
    (1.0, -0.5 * USUAL_LATENCY_S),
)
LEAST_LEFT_S = 0.003  # of a delay: the placing is true to that
PRESENT = (1,)  # a lagging law's setting to first order
ROUNDS = 2  # of a delay's refits
LONGER = 1.4  # times the likeliest delay: hardly less likely where speeds are read from long windows
# Of a delay's gain: from one delay to the next the likelihood jumps by so much, and speeds read from noisy events draw
# it to delays a fifth to a third too short (our own simulation, and sessions of another generator).
ROUGH = 0.1
OVERTAKES = 0.5  # of a sure name's gain: what the edges as they are placed promise less will not overtake it
LEAST_SURE_S = 0.01  # of another moment than the present one, for all that its interval allows


def delay_profile(fit: Fit, options: Sequence[Asked]) -> FloatArray:
    """Twice the log-likelihood of the edges of steady runs with the law asked at each option's speed, (k,).

    Law and all else are adjusted linearly, the delay is held. −inf where too few edges can be placed.
    """
    components = fit.whiteners[fit.best].components
    rest = [t for t in fit.terms if t.effect != LAGGING]
    out = np.full(len(options), -np.inf)
    told = fit.use & fit.placed.steady  # sudden changes of speed are too rough a test to choose by
    now = look(fit.runs, fit.law, fit.geometry, [*rest, Term(LAGGING, NOW, (0.0,))], fit.width_mm, None)
    weighed: tuple[np.ndarray, Whitener] | None = None
    for k, asked in enumerate(options):
        terms = [*rest, Term(LAGGING, asked, (0.0,))]
        state = look(fit.runs, fit.law, fit.geometry, terms, fit.width_mm, now)
        use = told & state.placed.ok & np.isfinite(state.residual)
        if np.count_nonzero(use) < 0.9 * np.count_nonzero(told):
            continue
        if weighed is None or not np.array_equal(use, weighed[0]):
            weighed = use, whitener(scatter(fit.runs, state.placed, use, state.blur_mm), components)
        white = weighed[1]
        value = profile(white, state.residual[use], state.design[use][:, :-1], state.prior[:-1])[0]
        out[k] = 2 * value * np.count_nonzero(told) / np.count_nonzero(use)
    return out


def with_what_is_left(term: Term, left_s: float) -> Term:
    """The term at the delay that its fit ended with."""
    which, delay_s = term.theta
    return Term(LAGGING, (which, float(np.clip(delay_s + left_s, -0.3, 0.3))), (0.0,))


def delayed(session: Session, before: Fit, finding: Finding, plateau: bool, sure: float) -> Fit | None:
    """The law asked at the speed of another moment, where that is likelier by far than the moments of sound panels.

    sure: gain of a sure name, beside which less is hopeless.
    """
    if any(t.effect in FOLLOW_ACCELERATION for t in before.terms):
        return None
    best: Fit | None = None
    profile = delay_profile(before, [*USUAL, *OTHER])
    usual, other = profile[: len(USUAL)], profile[len(USUAL) :]
    term = Term(LAGGING, OTHER[int(np.argmax(other))], (0.0,))
    asked_for = other.max() > usual.max() and other.max() - usual[0] > OVERTAKES * sure
    for _ in range(ROUNDS if asked_for else 0):
        fit = refit(session, before, [*before.terms, term], plateau, before.law)
        if fit is None or not possible(LAGGING, fit):
            break
        if best is None or fit.log_likelihood > best.log_likelihood:
            best = fit
        left_s = fit.terms[-1].sizes[0]
        if abs(left_s) < LEAST_LEFT_S:
            break
        term = with_what_is_left(term, left_s)
    if best is not None:
        # The likelihood is flat and rough towards longer delays: the gap on held-out runs decides.
        longer = with_what_is_left(best.terms[-1], (LONGER - 1) * best.terms[-1].theta[1])
        fit = refit(session, before, [*before.terms, longer], plateau, before.law)
        little = max(RARE, ROUGH * gained(before, best))
        if fit is not None and possible(LAGGING, fit) and gained(best, fit) > -little and gap_mm(fit) < gap_mm(best):
            best = fit
    if any(c.effect == LAGGING and c.theta == PRESENT for c in finding.significant):
        # Of a later speed a slow trace tells little: to first order it is told better than by that speed itself.
        fit = refit(session, before, [*before.terms, Term(LAGGING, PRESENT)], plateau)
        if fit is not None and possible(LAGGING, fit):
            best = fit if best is None or fit.log_likelihood > best.log_likelihood else best
    if best is None or gained(before, best) < 2 * RARE:
        return None
    low, high = parameters_of(LAGGING, best)["delay_s"][1]
    if low * high <= 0 or min(abs(low), abs(high)) < LEAST_SURE_S:
        return None
    theta = best.terms[-1].theta
    own = usual[0] + gained(before, best)  # of the first order's form; the other is compared under its own law
    if len(theta) == 2:
        own, *others = delay_profile(best, [(theta[0], theta[1]), *USUAL])
        usual = np.array(others)
    return best if own - usual.max() > RARE else None
