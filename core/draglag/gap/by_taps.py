"""What taps identify and edges cannot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import expit, logsumexp, ndtr

from draglag.gap.constants import P_EFFECT, STATED_AT_MOST
from draglag.gap.ends import OFFSET_SD_S, possible_ends
from draglag.gap.fitting.joint import Fit
from draglag.gap.posterior.linear import likeliest_levels, linearised, normal
from draglag.gap.posterior.pool import Pool
from draglag.instruments.taps import LONGEST_S, summarise_taps
from draglag.recording import FloatArray, Session, Taps
from draglag.simulation.effects import Effect

# How far releases of a sound rig lie from the asymptote, from panel to panel. Physical (fact sheet on taps).
TAP_SD_S = 0.0009
INTEREST_S = 0.0015  # tolerated: at 100 mm/s 0.15 mm, and a panel may treat a lift as it likes. Judgement
FEWEST = 15  # releases: a median's standard error of a third of their scatter. Derived
POINTS = 2001  # of the grid on which an offset's interval is read: a hundredth of a millisecond. Derived
AT_AN_END = 0.3  # of the time over which taps were made: those before and after the drags. Judgement


@dataclass(frozen=True)
class Offset:
    """Offset of releases from the asymptote."""

    value_s: float
    ci95_s: tuple[float, float]
    probability: float


def clock_offset(
    session: Session,
    fit: Fit,
    effects: Sequence[Effect] = (),
    held_s: float = 0.0,
    p_other: float = 0.0,
    early: tuple[float, float] = (0.0, 0.0),
) -> Offset | None:
    """Offset of releases from the curve's end, less what effects add; None with few.

    held_s: half the longest wait of only taps or only drags. p_other: of another form of the curve. early: known lead
    of drags, and its standard deviation, s.
    """
    if session.taps is None:
        return None
    origin_s = min(run.t_s[0] for run in fit.runs)
    registered_s, late_s = session.taps.registered_s, np.zeros(session.taps.registered_s.size)
    for effect in effects:  # a latency that creeps or settles, of taps as of drags: the fitted law has none of it
        late_s = effect.tap_latency(late_s, registered_s - origin_s)
    summary = summarise_taps(replace(session.taps, registered_s=registered_s - late_s)).get("release")
    if summary is None or summary.n < FEWEST:
        return None
    tap_se = (summary.ci95_s[1] - summary.ci95_s[0]) / 3.92
    ends = _ends_beyond(fit, p_other, tap_se**2 + held_s**2 / 3 + early[1] ** 2)
    return ends.offset(float(summary.median_s - fit.law.a7_s - early[0]))


def shares_by_edges(
    pool: Pool, fit: Fit, moved_mm: Mapping[str, Sequence[FloatArray]]
) -> tuple[dict[str, FloatArray], dict[str, float]]:
    """Likeliest shift and probability of each effect. moved_mm: its equally probable shifts, (m,)."""
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
    """Ends of the curve relative to the fitted asymptote, and their probabilities, (k,). variance: of releases, s²."""

    at_s: FloatArray
    weights: FloatArray
    variance: float

    def log_densities(self, off_s: float, more: float) -> FloatArray:
        """Log densities of releases, 1/s, times the ends' probabilities, (k,). more: variance added."""
        variance = self.variance + more
        squared = (off_s - self.at_s) ** 2 / variance
        return np.asarray(
            np.log(np.maximum(self.weights, np.finfo(float).tiny)) - 0.5 * (squared + np.log(2 * np.pi * variance))
        )

    def log_with_and_without(self, off_s: float) -> tuple[float, float]:
        """Joint log densities of releases with, and without, an offset of the clock."""
        each = ((P_EFFECT, OFFSET_SD_S), (1 - P_EFFECT, 0.0))
        with_it, without = (
            float(np.log(p) + logsumexp(self.log_densities(off_s, INTEREST_S**2 + sd_s**2))) for p, sd_s in each
        )
        return with_it, without

    def log_density(self, off_s: float) -> float:
        """Log density, with or without an offset."""
        return float(np.logaddexp(*self.log_with_and_without(off_s)))

    def offset(self, off_s: float) -> Offset:
        """Posterior of an offset, given releases at ``off_s``."""
        with_it, without = self.log_with_and_without(off_s)
        # A clock that is off by far more than clocks usually are is no nearer to them than it seems.
        shares = self.log_densities(off_s, max(OFFSET_SD_S, abs(off_s)) ** 2)
        shares = np.exp(shares - logsumexp(shares))
        sizes_s, sd_s = off_s - self.at_s, float(np.sqrt(self.variance))
        grid = np.linspace(sizes_s.min() - 4 * sd_s, sizes_s.max() + 4 * sd_s, POINTS)
        below = shares @ ndtr((grid - sizes_s[:, None]) / sd_s)
        low, high = np.interp([0.025, 0.975], below, grid)
        p = min(float(expit(with_it - without)), STATED_AT_MOST)
        return Offset(float(shares @ sizes_s), (float(low), float(high)), p)


def _ends_beyond(fit: Fit, p_other: float, variance: float = 0.0) -> Ends:
    """Ends of the curve. variance: of the taps' median, s²."""
    ends_s, weights = possible_ends(fit, p_other)
    return Ends(ends_s - fit.law.a7_s, weights, variance + TAP_SD_S**2)


@dataclass(frozen=True)
class Creep:
    """Probabilities of effects that only taps distinguish."""

    shares: dict[str, float]
    evidence: str

    @property
    def best(self) -> str:
        return max(self.shares, key=lambda name: self.shares[name])


def creep_of(session: Session, fit: Fit, effects: tuple[Effect, ...], p_other: float = 0.0) -> Creep:
    """Probabilities of effects, of fitted sizes, that drift alike on the edges."""
    even = {effect.id: 1 / len(effects) for effect in effects}
    if session.taps is None:
        return Creep(even, "no taps to distinguish a clock from a latency")
    ends = _ends(session.taps, min(run.t_s[0] for run in fit.runs))
    if ends is None:
        return _by_level(session, fit, effects, even, p_other)
    times, levels, variance = ends
    log_odds, moved = {}, {}
    for effect in effects:
        expected = effect.tap_latency(np.zeros(2), times)
        moved[effect.id] = float(expected[1] - expected[0])
        log_odds[effect.id] = -0.5 * float(levels[1] - levels[0] - moved[effect.id]) ** 2 / variance
    change = f"tap latency changed by {1e3 * (levels[1] - levels[0]):.1f} ms; expected "
    expected_words = ", ".join(f"{1e3 * moved[name]:+.1f} ({name})" for name in moved)
    return Creep(_shares(log_odds), change + expected_words)


def _by_level(session: Session, fit: Fit, effects: tuple[Effect, ...], even: dict[str, float], p_other: float) -> Creep:
    """``creep_of`` by taps at one end of the session."""
    assert session.taps is not None
    summary = summarise_taps(session.taps).get("release")
    if summary is None or summary.n < FEWEST:
        return Creep(even, "too few releases to distinguish a clock from a latency")
    origin_s = min(run.t_s[0] for run in fit.runs)
    when_s = np.array([float(np.median(session.taps.registered_s)) - origin_s])
    off = {e.id: summary.median_s - fit.law.a7_s - float(e.tap_latency(np.zeros(1), when_s)[0]) for e in effects}
    ends = _ends_beyond(fit, p_other)
    words = ", ".join(f"{1e3 * value:+.1f} ms ({name})" for name, value in off.items())
    return Creep(
        _shares({k: ends.log_density(v) for k, v in off.items()}),
        f"releases off the asymptote: {words}",
    )


def _shares(log_odds: dict[str, float]) -> dict[str, float]:
    top = max(log_odds.values())
    weights = {name: float(np.exp(value - top)) for name, value in log_odds.items()}
    return {name: weight / sum(weights.values()) for name, weight in weights.items()}


def _ends(taps: Taps, origin_s: float) -> tuple[FloatArray, FloatArray, float] | None:
    """Times and levels of taps at both ends of the session, variance of the levels' difference."""
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
