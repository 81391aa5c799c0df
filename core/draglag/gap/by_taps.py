"""What taps identify that edges cannot: whether the laser's clock is off, and whether clock or latency creeps.

Taps never touch the laser's clock. On a sound rig the latency of releases is the asymptote of the curve.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp
from scipy.stats import norm

from draglag.curve import CurvePoints, fit_best, fit_form
from draglag.curve.fit import CLEARLY_BETTER
from draglag.errors import EstimateError
from draglag.gap.constants import P_EFFECT, P_LAW_FORM, STATED_AT_MOST
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
    session: Session, fit: Fit, effects: Sequence[Effect] = (), held_s: float = 0.0, known_form: bool = True
) -> Offset | None:
    """Releases against the fitted asymptote; None without enough of them.

    effects: those named, as the simulation has them: what they do to taps is no offset. ``held_s``: a time that taps or
    drags may have waited for, one without the other. known_form: whether a form is known that describes the curve; if
    none is, it may go on falling beyond the fastest drag.
    """
    if session.taps is None:
        return None
    origin_s = min(run.t_s[0] for run in fit.runs)
    registered_s, late_s = session.taps.registered_s, np.zeros(session.taps.registered_s.size)
    for effect in effects:  # a latency that creeps or settles, of taps as of drags: the fitted law has none of it
        late_s = effect.tap_latency(late_s, registered_s - origin_s)
    registered_s = registered_s - late_s
    summary = summarise_taps(replace(session.taps, registered_s=registered_s)).get("release")
    if summary is None or summary.n < FEWEST:
        return None
    difference_s = summary.median_s - fit.law.a7_s
    ends = _ends_beyond(fit, known_form)
    tap_se = (summary.ci95_s[1] - summary.ci95_s[0]) / 3.92
    variance = fit.covariance[4, 4] + ends.left_s**2 + tap_se**2 + TAP_SD_S**2 + held_s**2 / 3
    reach_s = 1.96 * float(np.sqrt(variance))
    p = posterior_of(ends.missed_s(difference_s), variance + INTEREST_S**2, OFFSET_SD_S)
    low, high = difference_s - ends.highest_s - reach_s, difference_s - ends.lowest_s + reach_s
    return Offset(float(difference_s - ends.mean_s), (float(low), float(high)), p)


def shares_by_edges(
    pool: Pool, fit: Fit, moved_mm: Mapping[str, Sequence[FloatArray]]
) -> tuple[dict[str, FloatArray], dict[str, float]]:
    """The likeliest alternative and the probability of each of several effects of known sizes that taps show alike, by
    what each moves the edges by, (m,) mm of the fit; alternatives of an effect are alike probable."""
    linear = linearised(fit, frozenset(), pool.unsure_ages)
    levels = likeliest_levels(linear)
    likeliest, evidence = {}, {}
    for name, options in moved_mm.items():
        each = [normal(replace(linear, residual_mm=linear.residual_mm - moved), levels).base for moved in options]
        likeliest[name] = options[int(np.argmax(each))]
        evidence[name] = float(logsumexp(each) - np.log(len(each)))
    return likeliest, _shares(evidence)


@dataclass(frozen=True)
class Ends:
    """Where the forms end that describe the runs, against the fitted asymptote, s: the lowest, the highest, and their
    mean weighted by the Akaike weight of each. left_s: standard deviation of each. of_any_s: the range of a form that
    nobody knows, which may go on falling, or end where the drags do."""

    lowest_s: float
    highest_s: float
    mean_s: float
    left_s: float
    of_any_s: tuple[float, float]

    def missed_s(self, difference_s: float) -> float:
        """What no form reaches of a difference from the fitted asymptote: how large it is depends on which it is."""
        return difference_s - min(max(difference_s, self.lowest_s), self.highest_s)


def _ends_beyond(fit: Fit, known_form: bool) -> Ends:
    """Where a curve tends to lies beyond the fastest drag: Eq. 5 as fitted, and all forms as good as the best."""
    fastest = float(np.quantile(fit.view.speed, 0.95))
    of_any_s = -float(fit.law.a7_s), float(fit.law(np.array([fastest]))[0] - fit.law.a7_s)
    left_s = BEYOND * of_any_s[1]
    # Runs that drift, each by its own, lie on no curve: what found effects add to a run is no part of its form.
    rows = [
        (e.speed_mm_s, e.latency_s - added_s, e.curve_se_s)
        for e, added_s in zip((data.estimate for data in fit.runs), latency_of_terms(fit), strict=True)
        if e is not None and e.latency_s is not None and e.speed_mm_s is not None
    ]
    try:
        best = fit_best(CurvePoints(*np.array(rows, float).T))
    except EstimateError:
        return Ends(0.0, 0.0, 0.0, left_s, of_any_s)
    points, least = best.points, best.rivals[0].aicc
    alike = [r for r in best.rivals if points is not None and r.aicc - least < CLEARLY_BETTER]
    curves = [fit_form(points, r.form) for r in alike] if points is not None else []
    ends_s = [float(curve.predict_s(np.array([FAR_MM_S]))[0] - fit.law.a7_s) for curve in curves]
    weights = [float(np.exp(0.5 * (least - r.aicc))) for r in alike]
    mean_s = float(np.average(ends_s, weights=weights)) if ends_s else 0.0
    possible = [0.0, *ends_s] if known_form else [0.0, *ends_s, *of_any_s]
    return Ends(min(possible), max(possible), mean_s, left_s, of_any_s)


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


def creep_of(session: Session, fit: Fit, effects: tuple[Effect, ...], known_form: bool = True) -> Creep:
    """Effects of a session that drift alike on the edges, by how the taps drifted.

    effects: of fitted sizes, as the simulation has them: each predicts what it does to a tap's latency.
    """
    even = {effect.id: 1 / len(effects) for effect in effects}
    if session.taps is None:
        return Creep(even, "no taps to distinguish a clock from a latency")
    ends = _ends(session.taps, min(run.t_s[0] for run in fit.runs))
    if ends is None:
        return _by_level(session, fit, effects, even, known_form)
    times, levels, variance = ends
    log_odds, moved = {}, {}
    for effect in effects:
        expected = effect.tap_latency(np.zeros(2), times)
        moved[effect.id] = float(expected[1] - expected[0])
        log_odds[effect.id] = -0.5 * float(levels[1] - levels[0] - moved[effect.id]) ** 2 / variance
    change = f"tap latency changed by {1e3 * (levels[1] - levels[0]):.1f} ms; expected "
    expected_words = ", ".join(f"{1e3 * moved[name]:+.1f} ({name})" for name in moved)
    return Creep(_shares(log_odds), change + expected_words)


def _by_level(
    session: Session, fit: Fit, effects: tuple[Effect, ...], even: dict[str, float], known_form: bool
) -> Creep:
    """By taps at one end alone: their level against the asymptote that each effect leaves."""
    assert session.taps is not None
    summary = summarise_taps(session.taps).get("release")
    if summary is None or summary.n < FEWEST:
        return Creep(even, "too few releases to distinguish a clock from a latency")
    origin_s = min(run.t_s[0] for run in fit.runs)
    when_s = np.array([float(np.median(session.taps.registered_s)) - origin_s])
    off = {e.id: summary.median_s - fit.law.a7_s - float(e.tap_latency(np.zeros(1), when_s)[0]) for e in effects}
    ends = _ends_beyond(fit, known_form)
    variance = fit.covariance[4, 4] + ends.left_s**2 + TAP_SD_S**2 + INTEREST_S**2
    words = ", ".join(f"{1e3 * value:+.1f} ms ({name})" for name, value in off.items())
    return Creep(
        _shares({k: _log_density(v, ends, variance) for k, v in off.items()}),
        f"releases off the asymptote: {words}",
    )


def _log_density(off_s: float, ends: Ends, variance: float) -> float:
    """Log density of releases that far off the asymptote: the curve ends as a form that describes the runs, or anywhere
    that a form nobody knows may end; an offset of the clock may come on top."""
    missed_s = ends.missed_s(off_s)
    known = sum(
        p * norm.pdf(missed_s, 0.0, np.sqrt(v))
        for p, v in ((1 - P_EFFECT, variance), (P_EFFECT, variance + OFFSET_SD_S**2))
    )
    low, high = ends.of_any_s
    inside = norm.cdf(high, off_s, np.sqrt(variance)) - norm.cdf(low, off_s, np.sqrt(variance))
    any_form = inside / max(high - low, np.sqrt(variance))
    return float(np.log(max((1 - P_LAW_FORM) * known + P_LAW_FORM * any_form, np.finfo(float).tiny)))


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
