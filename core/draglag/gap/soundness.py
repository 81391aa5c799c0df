"""Whether the scatter that is left is the scatter of a sound rig: noise must not be a name for what is missing."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

from draglag.gap.finding import Candidate
from draglag.gap.fit import Fit, log_likelihood_of
from draglag.gap.noise import scatter

# What single edges scatter by on sound panels beyond the touch noise, from none to the most (generated sound sessions).
SOUND_EDGE_MM = (0.0, 0.05, 0.1)
SOUND_SPEED = (0.0, 0.01, 0.02)
SOUND_UNEVEN = 0.1
# Twice the log-likelihood by which more scatter fits better; on sound sessions it is never above zero.
MOST = 100.0
MOST_PER_EDGE = 0.3


def excess_scatter(fit: Fit) -> Candidate | None:
    """The scatter of single edges where it is more than that of a sound rig, as a structure without a name."""
    parts = scatter(fit.runs, fit.placed, fit.use, fit.blur_mm)
    now = fit.whiteners[fit.best].components
    sound = [
        replace(now, edge_mm=edge, speed=speed, uneven=SOUND_UNEVEN)
        for edge, speed in product(SOUND_EDGE_MM, SOUND_SPEED)
    ]
    excess = 2 * (log_likelihood_of(fit, parts, now) - max(log_likelihood_of(fit, parts, c) for c in sound))
    if excess < MOST or excess < MOST_PER_EDGE * fit.use.sum():
        return None
    return Candidate(None, "scatter", "latency", float(excess), 1, 1, 0.0)
