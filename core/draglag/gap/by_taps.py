"""What taps identify that edges cannot: whether the laser's clock is off, and whether clock or latency creeps.

Taps never touch the laser's clock. On a sound rig the latency of releases is the asymptote of the curve.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from draglag.curve import CurvePoints, fit_best, fit_form
from draglag.curve.fit import CLEARLY_BETTER
from draglag.errors import EstimateError
from draglag.gap.constants import P_EFFECT, STATED_AT_MOST
from draglag.gap.fitting.joint import Fit, latency_of_terms
from draglag.gap.posterior.linear import likeliest_levels, linearised, normal
from draglag.gap.posterior.pool import Pool
from draglag.instruments.taps import LONGEST_S, summarise_taps
from draglag.recording import FloatArray, Session, Taps
from draglag.simulation.effects import Effect

TAP_SD_S = 0.0009  # how far releases lie from the asymptote of a sound rig, from panel to panel (fact sheet on taps)
INTEREST_S = 0.0015  # tolerated: at 100 mm/s 0.15 mm, and a panel may treat a lift as it likes
OFFSET_SD_S = 0.01  # of an offset of interest: clocks that nobody compared differ by some milliseconds
BEYOND = 0.15  # how well the law's fall beyond the fastest speed is known, as a share of it
FEWEST = 15  # releases
FAR_MM_S = 1e5  # where every curve has come to its end
AT_AN_END = 0.3  # of the time over which taps were made


@dataclass(frozen=True)
class Offset:
    """Releases that disagree with the asymptote: value and 95 % interval, s; probability that this is an offset."""

    value_s: float
    ci95_s: tuple[float, float]
    probability: float


def clock_offset(
    session: Session, fit: Fit, creep_s_per_s: float = 0.0, held_s: float = 0.0, known_form: bool = True
) -> Offset | None:
    """Releases against the fitted asymptote; None without enough of them.

    ``creep_s_per_s`` is the latency's own creep, which the taps share; ``held_s`` a time that taps or drags may have
    waited for, one without the other. known_form: whether a form is known that describes the curve; if none is, it may
    go on falling beyond the fastest drag.
    """
    if session.taps is None:
        return None
    origin_s = min(run.t_s[0] for run in fit.runs)
    # Taps before and after the runs lie at two ends of a creep: each is brought back to the session's beginning.
    registered_s = session.taps.registered_s - creep_s_per_s * (session.taps.registered_s - origin_s)
    summary = summarise_taps(replace(session.taps, registered_s=registered_s)).get("release")
    if summary is None or summary.n < FEWEST:
        return None
    difference = summary.median_s - fit.law.a7_s
    difference, left_s = _beyond(fit, difference, known_form)
    tap_se = (summary.ci95_s[1] - summary.ci95_s[0]) / 3.92
    variance = fit.covariance[4, 4] + left_s**2 + tap_se**2 + TAP_SD_S**2 + held_s**2 / 3
    reach_s = 1.96 * float(np.sqrt(variance))
    p = posterior_of(difference, variance + INTEREST_S**2, OFFSET_SD_S)
    return Offset(float(difference), (float(difference - reach_s), float(difference + reach_s)), p)


def shares_by_edges(pool: Pool, fit: Fit, moved_mm: Mapping[str, FloatArray]) -> dict[str, float]:
    """Probability of each of several effects of known sizes that taps show alike, by what each moves the edges by, (m,)
    mm of the fit."""
    linear = linearised(fit, frozenset(), pool.unsure_ages)
    levels = likeliest_levels(linear)
    evidence = {}
    for name, moved in moved_mm.items():
        evidence[name] = normal(replace(linear, residual_mm=linear.residual_mm - moved), levels).base
    return _shares(evidence)


def _beyond(fit: Fit, difference_s: float, known_form: bool) -> tuple[float, float]:
    """A difference from the asymptote as the forms allow it that describe the runs as well as Eq. 5, and its standard
    deviation: where a curve tends to lies beyond the fastest drag, and only what no form reaches is a difference."""
    fastest = float(np.quantile(fit.view.speed, 0.95))
    least_s = BEYOND * (float(fit.law(np.array([fastest]))[0]) - fit.law.a7_s)
    # Runs that drift, each by its own, lie on no curve: what found effects add to a run is no part of its form.
    rows = [
        (e.speed_mm_s, e.latency_s - added_s, e.curve_se_s)
        for e, added_s in zip((data.estimate for data in fit.runs), latency_of_terms(fit), strict=True)
        if e is not None and e.latency_s is not None and e.speed_mm_s is not None
    ]
    try:
        best = fit_best(CurvePoints(*np.array(rows, float).T))
    except EstimateError:
        return difference_s, least_s
    points = best.points
    alike = [r.form for r in best.rivals if points is not None and r.aicc - best.rivals[0].aicc < CLEARLY_BETTER]
    curves = [fit_form(points, form) for form in alike] if points is not None else []
    ends_s = [] if known_form else [-fit.law.a7_s]
    ends_s += [float(curve.predict_s(np.array([FAR_MM_S]))[0]) - fit.law.a7_s for curve in curves]
    low, high = min([0.0, *ends_s]), max([0.0, *ends_s])
    left = difference_s - min(max(difference_s, low), high)
    return left, least_s


def posterior_of(value: float, variance: float, slab_sd: float) -> float:
    """Probability that a value is more than noise of this variance: one effect of the library, N(0, slab²)."""
    whole = variance + slab_sd**2
    log_odds = 0.5 * np.log(variance / whole) + 0.5 * value**2 * (1 / variance - 1 / whole)
    log_odds += np.log(P_EFFECT / (1 - P_EFFECT))
    return float(min(1 / (1 + np.exp(-min(log_odds, 500.0))), STATED_AT_MOST))


@dataclass(frozen=True)
class Creep:
    """Which of the effects that move edges alike moved the taps, too. shares: id → probability of each."""

    shares: dict[str, float]
    evidence: str

    @property
    def best(self) -> str:
        return max(self.shares, key=lambda name: self.shares[name])


def creep_of(session: Session, fit: Fit, effects: tuple[Effect, ...]) -> Creep:
    """Effects of a session that drift alike on the edges, by how the taps drifted.

    effects: of fitted sizes, as the simulation has them: each predicts what it does to a tap's latency.
    """
    even = {effect.id: 1 / len(effects) for effect in effects}
    if session.taps is None:
        return Creep(even, "no taps to distinguish a clock from a latency")
    ends = _ends(session.taps, min(run.t_s[0] for run in fit.runs))
    if ends is None:
        return _by_level(session, fit, effects, even)
    times, levels, variance = ends
    log_odds, moved = {}, {}
    for effect in effects:
        expected = effect.tap_latency(np.zeros(2), times)
        moved[effect.id] = float(expected[1] - expected[0])
        log_odds[effect.id] = -0.5 * float(levels[1] - levels[0] - moved[effect.id]) ** 2 / variance
    change = f"tap latency changed by {1e3 * (levels[1] - levels[0]):.1f} ms; expected "
    expected_words = ", ".join(f"{1e3 * moved[name]:+.1f} ({name})" for name in moved)
    return Creep(_shares(log_odds), change + expected_words)


def _by_level(session: Session, fit: Fit, effects: tuple[Effect, ...], even: dict[str, float]) -> Creep:
    """By taps at one end alone: their level against the asymptote that each effect leaves."""
    assert session.taps is not None
    summary = summarise_taps(session.taps).get("release")
    if summary is None or summary.n < FEWEST:
        return Creep(even, "too few releases to distinguish a clock from a latency")
    origin_s = min(run.t_s[0] for run in fit.runs)
    when_s = np.array([float(np.median(session.taps.registered_s)) - origin_s])
    off = {e.id: summary.median_s - fit.law.a7_s - float(e.tap_latency(np.zeros(1), when_s)[0]) for e in effects}
    variance = fit.covariance[4, 4] + TAP_SD_S**2 + INTEREST_S**2
    words = ", ".join(f"{1e3 * value:+.1f} ms ({name})" for name, value in off.items())
    return Creep(_shares({k: -0.5 * v**2 / variance for k, v in off.items()}), f"releases off the asymptote: {words}")


def _shares(log_odds: dict[str, float]) -> dict[str, float]:
    top = max(log_odds.values())
    weights = {name: float(np.exp(value - top)) for name, value in log_odds.items()}
    return {name: weight / sum(weights.values()) for name, weight in weights.items()}


def _ends(taps: Taps, origin_s: float) -> tuple[FloatArray, FloatArray, float] | None:
    """Times since the session began, s, and levels, s, of the taps of the two ends, and the variance of the levels'
    difference; None where they were made at one end only."""
    latency_s = taps.registered_s - taps.physical_s
    good = np.isfinite(latency_s) & (latency_s >= 0) & (latency_s <= LONGEST_S)
    at_s, latency_s, down = taps.registered_s[good] - origin_s, latency_s[good], taps.down[good]
    if at_s.size < FEWEST:
        return None
    span_s = float(np.ptp(at_s))
    ends = at_s < at_s.min() + AT_AN_END * span_s, at_s > at_s.max() - AT_AN_END * span_s
    middle_s = span_s * (1 - 2 * AT_AN_END)
    if middle_s < 60.0 or min(np.count_nonzero(end) for end in ends) < FEWEST // 2:
        return None
    levels, variance = [], 2 * (0.5 * INTEREST_S) ** 2
    for end in ends:
        each = [latency_s[end & (down == kind)] for kind in (0, 1)]
        each = [values for values in each if values.size > 1]
        if not each:
            return None
        levels.append(float(np.mean([np.median(values) for values in each])))
        variance += float(np.mean([np.var(values) * 1.57 / values.size for values in each]))  # of a median
    times = np.array([float(np.median(at_s[end])) for end in ends])
    return times, np.array(levels), variance
