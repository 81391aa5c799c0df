"""Refits of a lagging law over a grid of delays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from draglag.gap.constants import GIVEN_UP
from draglag.gap.fitting.joint import Fit, gained_nats
from draglag.gap.fitting.likelihood import profile
from draglag.gap.fitting.noise import scatter
from draglag.gap.fitting.state import Term, linearise
from draglag.gap.fitting.whitening import Whitener, whitener
from draglag.gap.proposing.plain import refit
from draglag.gap.traces.law_speed import NO_DELAY, SpeedDelay
from draglag.recording import FloatArray, Session
from draglag.simulation.effects.lagging_law import LATEST_OF_SOUND_S, LaggingLaw, Setting
from draglag.simulation.law import USUAL_LATENCY_S

USUAL: tuple[SpeedDelay, ...] = ((0.0, 0.0), (0.0, LATEST_OF_SOUND_S))
LONGEST_S = 0.3
DELAYS_S = (0.025, 0.035, 0.05, 0.07, 0.1, 0.15)
LATER_S = (0.035, 0.07, 0.12)  # after the edge's moment: as late as slow drags are reported
OTHER: tuple[SpeedDelay, ...] = (
    *((0.0, s) for s in DELAYS_S),
    *((0.0, -s) for s in LATER_S),
    (1.0, -0.5 * USUAL_LATENCY_S),
)
FEW: tuple[SpeedDelay, ...] = ((0.0, 0.05), (0.0, 0.1), (0.0, 0.15), (0.0, -0.035), OTHER[-1])  # enough to see another
LEAST_LEFT_S = 0.003  # of a delay: the placing is true to that
LONGER = 1.4  # times the likeliest delay: hardly less likely where speeds are read from long windows
KEPT = 0.9  # of the edges of steady runs, that a delay has to place
ROUNDS = 3


def shown_by_traces(before: Fit) -> float:
    """Nats by which another delay fits better than those of sound panels."""
    return _likeliest(before, FEW)[1]


def _likeliest(before: Fit, options: Sequence[SpeedDelay]) -> tuple[SpeedDelay, float]:
    """Likeliest option, and its nats over delays of sound panels, −∞ if none can be placed."""
    found = delay_profile(before, [*USUAL, *options])
    other, sound = found[len(USUAL) :], np.max(found[: len(USUAL)])
    nats = 0.5 * float(np.max(other) - sound) if np.isfinite(sound) else 0.0
    return options[int(np.argmax(other))], nats if np.isfinite(other).any() else -np.inf


def refits(session: Session, before: Fit, theta: tuple[float, ...]) -> list[Fit | None]:
    """Refits at the likeliest delay of a grid, at what is left of it, and at a longer one, as long as they gain.

    Empty where every delay is by ``GIVEN_UP`` less likely than those of sound panels: none of four such refits gained.
    """
    delay, nats = _likeliest(before, OTHER)
    if nats < -GIVEN_UP:
        return []
    term = Term(LaggingLaw.id, delay, (0.0,))
    best, out = before, list[Fit | None]()
    tried: list[tuple[float, float]] = []  # delays, and what was left at each
    for _ in range(ROUNDS):
        fit = refit(session, before, [*before.terms, term])
        if fit is None:
            break
        left_s = fit.terms[-1].sizes[0]
        tried.append((_delay_s(term), left_s))
        if gained_nats(best, fit) >= 0:
            best = fit
        elif len(tried) < 2 or left_s * tried[-2][1] > 0:
            break  # it lies neither here nor between the last two
        out.append(fit)
        if abs(left_s) < LEAST_LEFT_S:
            break
        term = with_remaining_delay(term, step_s(tried))
    if out:
        last = best.terms[-1]
        longer = with_remaining_delay(last, (LONGER - 1) * _delay_s(last))
        out.append(refit(session, before, [*before.terms, longer]))
    return out


def step_s(tried: Sequence[tuple[float, float]]) -> float:
    """Step from the last delay to where nothing is left: by the secant where the last two lie on either side of it."""
    delay_s, left_s = tried[-1]
    before_s, left_before_s = tried[-2] if len(tried) > 1 else (delay_s, left_s)
    if left_s * left_before_s >= 0:
        return left_s
    return (before_s - delay_s) * left_s / (left_s - left_before_s)


def with_remaining_delay(term: Term, left_s: float) -> Term:
    """Term at the delay its fit ended with."""
    delay_s = float(np.clip(_delay_s(term) + left_s, -LONGEST_S, LONGEST_S))
    return Term(term.effect, (Setting(*term.theta).which, delay_s), (0.0,))


def _delay_s(term: Term) -> float:
    return Setting(*term.theta).delay_s or 0.0


def delay_profile(fit: Fit, options: Sequence[SpeedDelay]) -> FloatArray:
    """Twice the profile log-likelihood of steady runs' edges at each option, (k,); −inf with too few edges."""
    components = fit.white.components
    rest = [t for t in fit.terms if t.effect != LaggingLaw.id]
    out = np.full(len(options), -np.inf)
    steady = fit.use & fit.placed.steady  # sudden changes of speed are too rough a test to choose by
    now = linearise(fit.runs, fit.law, fit.geometry, rest, fit.width_mm, None, NO_DELAY)
    whitened: tuple[np.ndarray, Whitener] | None = None
    for k, delay in enumerate(options):
        state = linearise(fit.runs, fit.law, fit.geometry, rest, fit.width_mm, now, delay)
        use = steady & state.placed.ok & np.isfinite(state.residual)
        if not use.any() or np.count_nonzero(use) < KEPT * np.count_nonzero(steady):
            continue
        if whitened is None or not np.array_equal(use, whitened[0]):
            whitened = use, whitener(scatter(fit.runs, state.placed, use, state.blur_mm), components)
        value = profile(whitened[1], state.residual[use], state.design[use], state.prior)[0]
        out[k] = 2 * value * np.count_nonzero(steady) / np.count_nonzero(use)
    return out
