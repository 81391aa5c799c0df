"""Whether the law follows the speed of another moment: looked for by asking it at that speed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from draglag.gap.asked import NOW, Asked
from draglag.gap.fit import Fit
from draglag.gap.likelihood import profile
from draglag.gap.noise import scatter
from draglag.gap.state import LAGGING, Term, look
from draglag.gap.whitening import Whitener, whitener
from draglag.recording import FloatArray
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
