"""The joint refit with another term: what it gains, and whether its size can be."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from draglag.errors import EstimateError
from draglag.gap.fitting.joint import RIPPLE, Fit, fit_session, log_likelihood_on
from draglag.gap.fitting.model import LawParameters
from draglag.gap.fitting.parameters import parameters_of
from draglag.gap.fitting.state import Term
from draglag.recording import Session
from draglag.simulation.effects import EFFECTS

PLATEAU, MODE, SMOOTHING = "low_speed_plateau", "second_filter_mode", "smoothing_shrink"
SAME_MODEL_BETTER = 6.0  # twice the log-likelihood by which a second start beats the first
HOPELESS = 0.3  # of a sure name's gain: what promises less before its refit will not overtake it
SETTLING = 4  # refits of what is found beside its own setting
RARE = 10.0  # gain after its price that chance alone gives to fewer than one session in a hundred
# Of an effect's typical size, 0.1 where not said: less is of no use to anybody, and a proxy more likely than itself.
# The position fits bend circles as a low-pass of some 8 ms would; a hand's acceleration is some 100 mm/s², and the time
# that a speed belongs to is known to some 30 ms.
SMALLEST = {
    "smoothing_shrink": 0.6,
    "acceleration_lag": 1.0,
    "lagging_law": 0.75,
    "second_filter_mode": 0.33,
    "pitch_ripple": 0.25,
    "direction_asymmetry": 0.2,
}
MOST_LOST, LEAST_JUDGED = 0.1, 0.6  # of the edges
BEYOND_SLOWEST = 1.25  # a plateau must hold for more than the slowest run


def refit(
    session: Session,
    before: Fit,
    terms: Sequence[Term],
    plateau: bool,
    law: LawParameters | None = None,
    only: np.ndarray | None = None,
) -> Fit | None:
    """The model with these terms, on the edges of ``before`` (``only`` those); None where it cannot be fitted."""
    try:
        return fit_session(session, before.runs, terms, plateau, before, law, only)
    except (EstimateError, np.linalg.LinAlgError):
        return None


def gained(before: Fit, after: Fit) -> float:
    """Twice the log-likelihood that ``after`` gains on the edges that both use; −∞ if it lost many of those that it was
    to judge by."""
    both = before.use & after.use
    asked = before.use if after.only is None else before.use & after.only
    total = int(before.use.sum())
    if asked.sum() < LEAST_JUDGED * total or np.count_nonzero(asked & ~after.use) > MOST_LOST * total:
        return -np.inf
    return 2 * (
        after.log_likelihood - (before.log_likelihood if both.sum() == total else log_likelihood_on(before, both))
    )


def possible(effect: str, fit: Fit) -> bool:
    """Whether the size can matter and lies within the bounds of the effect's class: a low-pass cannot swell."""
    numbers = parameters_of(effect, fit)
    if effect == SMOOTHING and numbers["time_constant_s"][0] <= 0:
        return False
    if effect == RIPPLE and fit.runs[0].lattice is None:
        return False  # thousands of events show one that a hundred edges can
    leading = EFFECTS[effect].parameters[0]
    if leading.name in numbers:
        size = abs(numbers[leading.name][0])
        if size < SMALLEST.get(effect, 0.1) * abs(leading.typical):
            return False
    if effect == PLATEAU:
        slowest = min(float(fit.view.speed[fit.run_index == k].mean()) for k in np.unique(fit.run_index))
        if fit.law.plateau_mm_s < BEYOND_SLOWEST * slowest:
            return False
    for spec in EFFECTS[effect].parameters:
        if spec.name in numbers and not spec.lower <= numbers[spec.name][0] <= spec.upper:
            return False
    return True
