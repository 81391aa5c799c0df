"""What edges alone cannot tell apart: taps where they help, and plain words where nothing does."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from draglag.gap.fitting.joint import Fit
from draglag.recording import FloatArray, Run, Session
from draglag.simulation.effects import effect_class
from draglag.taps import LONGEST_S, summarise_taps

TAP_SD_S = 0.0009  # how far release taps lie from the asymptote of a sound rig, from panel to panel
OFFSET_S = 0.003  # a smaller difference of tap and asymptote is the panel's own
TOO_SUDDEN = "a slower chirp or step: no edge of those here could be placed surely"
CHANGING = ("chirp", "multisine", "step")
FEWEST_EDGES = 6  # of a run that counts
BACK_AT_MOST = 0.01  # of the touch events
BEYOND = 0.15  # how well the law's fall beyond the fastest speed is known, as a share of it


@dataclass(frozen=True)
class DriftVerdict:
    effect: str
    indistinguishable_from: tuple[str, ...]
    evidence: str


def which_drift(session: Session, fit: Fit, drift: float, candidates: frozenset[str]) -> DriftVerdict:
    """Clock or latency? A drifting laser clock leaves taps alone; a creeping latency moves them with it.

    Args:
        drift: s/s by which the laser's stamps gain (the latency reads shorter).
    """
    other = tuple(e for e in ("thermal_drift",) if e in candidates)
    if "clock_drift" not in candidates:
        return DriftVerdict("thermal_drift", (), "")
    taps = session.taps
    if taps is None or taps.registered_s.size < 20 or not other:
        return DriftVerdict("clock_drift", other, "no taps to tell a clock from a latency")
    origin_s = min(run.t_s[0] for run in fit.runs)
    latency_s = taps.registered_s - taps.physical_s
    good = np.isfinite(latency_s) & (latency_s >= 0) & (latency_s <= LONGEST_S)
    at_s, latency_s, down = taps.registered_s[good] - origin_s, latency_s[good], taps.down[good]
    # Both ends: the taps' own change against the change each cause predicts.
    span_s = float(np.ptp(at_s))
    early, late = at_s < at_s.min() + 0.3 * span_s, at_s > at_s.max() - 0.3 * span_s
    moved = abs(drift) * span_s
    session_s = float(np.ptp(fit.view.since_start_s))
    if span_s > 0.5 * session_s and moved > 0.0015 and min(np.count_nonzero(early), np.count_nonzero(late)) >= 8:
        change = float(
            np.mean([_median(latency_s, late & (down == k)) - _median(latency_s, early & (down == k)) for k in (0, 1)])
        )
        expected = -drift * float(np.median(at_s[late]) - np.median(at_s[early]))
        clock = abs(change) < abs(change - expected)
        words = f"tap latency changed by {1e3 * change:.1f} ms where the edges say {1e3 * expected:.1f} ms"
        sure = abs(expected) > 0.0025
        return _verdict(clock, sure, words)
    release = _median(latency_s, down == 0)
    if not np.isfinite(release):
        return DriftVerdict("clock_drift", other, "no release taps")
    asymptote_s = fit.law.a7_s
    when_s = float(np.median(at_s))
    if_clock, if_thermal = release - asymptote_s, release - (asymptote_s - drift * when_s)
    apart = abs(drift * when_s)
    words = (
        f"release taps lie {1e3 * if_clock:+.1f} ms off the asymptote if the clock drifts, else {1e3 * if_thermal:+.1f}"
    )
    return _verdict(
        abs(if_clock) < abs(if_thermal), apart > 0.006 and min(abs(if_clock), abs(if_thermal)) < 0.3 * apart, words
    )


def _verdict(clock: bool, sure: bool, words: str) -> DriftVerdict:
    name, rest = ("clock_drift", "thermal_drift") if clock else ("thermal_drift", "clock_drift")
    return DriftVerdict(name, () if sure else (rest,), words)


def _median(values: FloatArray, keep: np.ndarray) -> float:
    return float(np.median(values[keep])) if keep.any() else float("nan")


@dataclass(frozen=True)
class Offset:
    """A clock offset seen as taps that disagree with the asymptote: value and 95 % interval in s."""

    value_s: float
    ci95_s: tuple[float, float]
    p_value: float


def clock_offset(session: Session, fit: Fit, creep_s_per_s: float = 0.0, held_s: float = 0.0) -> Offset | None:
    """Release taps against the fitted asymptote (equal on a sound rig); None where they agree or there are too few.

    ``creep_s_per_s`` is the latency's own creep, which the taps share; ``held_s`` a time that taps or drags may have
    waited for, one without the other: a difference has to be larger than that, and is known no better.
    """
    taps = session.taps
    if taps is None:
        return None
    origin_s = min(run.t_s[0] for run in fit.runs)
    # Taps before and after the runs lie at two ends of a creep: each is brought back to the session's beginning.
    crept_s = creep_s_per_s * (taps.registered_s - origin_s)
    summary = summarise_taps(replace(taps, registered_s=taps.registered_s - crept_s)).get("release")
    if summary is None or summary.n < 15:
        return None
    a7_variance = fit.covariance[4, 4]
    difference = summary.median_s - fit.law.a7_s
    # The law tends to its asymptote only beyond the measured speeds: what is left at the fastest is its uncertainty.
    fastest = float(np.quantile(fit.view.speed, 0.95))
    left_s = BEYOND * (float(fit.law(np.array([fastest]))[0]) - fit.law.a7_s)
    tap_se = (summary.ci95_s[1] - summary.ci95_s[0]) / 3.92
    se = float(np.sqrt(a7_variance + left_s**2 + tap_se**2 + TAP_SD_S**2))
    p = 2 * float(norm.sf((abs(difference) - held_s) / se))
    if abs(difference) < OFFSET_S + held_s or p > 1e-3:
        return None
    reach_s = float(np.hypot(1.96 * se, held_s))
    return Offset(difference, (difference - reach_s, difference + reach_s), p)


def not_seen(session: Session, fit: Fit) -> dict[str, str]:
    """Effects this session could not have shown, and the run that would show them."""
    out = {"contact_trail": "a fixed trail hides in the latency law: a tap or a second stylus shows it"}
    if all(term.effect != "beam_width" for term in fit.terms):  # then its step says so
        out["scale_error"] = effect_class("scale_error").shown_apart_by
    if session.taps is None or session.taps.registered_s.size < 20:
        out["clock_offset"] = "taps timed on the same clock show it"
        out["thermal_drift"] = effect_class("thermal_drift").shown_apart_by
    if not any(np.count_nonzero(fit.run_index == k) for k, d in enumerate(fit.runs) if not d.steady):
        there = any(run.protocol in CHANGING for run in session.runs)
        for effect in ("lagging_law", "acceleration_lag"):
            out[effect] = TOO_SUDDEN if there else effect_class(effect).shown_apart_by
    if float(np.ptp(fit.view.x_mm)) < 0.25 * fit.width_mm:
        for effect in ("scan_skew", "beam_wedge", "spatial_warp", "pitch_ripple"):
            out[effect] = "circles that travel across the whole width show it"
    return out


def what_is_missing(session: Session) -> tuple[str, ...]:
    """Plain words on what a session lacks before any verdict can be given; empty when it has enough."""
    steady = [r for r in session.runs if r.protocol in ("circle", "free") and r.laser.t_s.size >= FEWEST_EDGES]
    missing = []
    if len(steady) < 5:
        missing.append(f"{_counted(len(steady), 'circle run')} with edges: at least 5 are needed")
    speeds = sorted({round(r.nominal_speed_mm_s) for r in steady if r.nominal_speed_mm_s})
    if speeds and (len(speeds) < 4 or speeds[-1] < 3 * speeds[0]):
        missing.append(f"{_counted(len(speeds), 'drag speed')}: at least 4, spread over a factor of 3, are needed")
    edges = sum(r.laser.t_s.size for r in session.runs)
    if edges < 80:
        missing.append(f"{_counted(edges, 'edge')}: at least 80 are needed")
    disorder = times_out_of_order(session)
    if disorder:
        return (*missing, disorder)
    shown = [r for r in steady if np.count_nonzero(np.isfinite(r.touch.x_mm) & np.isfinite(r.touch.y_mm)) > 50]
    travel = [_travel_mm(r) for r in shown]
    apart = [r for r in shown if _edges_while_touched(r) < FEWEST_EDGES]
    if steady and not shown:
        missing.append("no circle run shows where the stylus was: its touch positions are missing or not numbers")
    elif travel and max(travel) < 5.0:
        missing.append("the circles hardly travel sideways: slope and latency cannot be told apart")
    elif apart and len(shown) - len(apart) < 5:
        missing.append(
            f"edges and touch events of {len(apart)} of {len(steady)} circle runs lie at different times: "
            "both have to be on one clock"
        )
    return tuple(missing)


def times_out_of_order(session: Session) -> str:
    """In words the runs whose touch events have times that are no numbers or go back; empty where none has."""
    bad = [run.id for run in session.runs if _is_out_of_order(run.touch.t_s)]
    if not bad:
        return ""
    some = ", ".join(bad[:3]) + (f" and {len(bad) - 3} more" if len(bad) > 3 else "")
    return f"touch times of {some} go back or are no numbers: exported and imported again they are put in order"


def _is_out_of_order(t_s: FloatArray) -> bool:
    """A stamp or two may change places on the way; more is no recording in order of its stamps."""
    return bool(not np.isfinite(t_s).all() or np.count_nonzero(np.diff(t_s) < 0) > BACK_AT_MOST * t_s.size)


def _edges_while_touched(run: Run) -> int:
    t_s, slack_s = run.touch.t_s, 1.0
    return int(np.count_nonzero((run.laser.t_s > t_s[0] - slack_s) & (run.laser.t_s < t_s[-1] + slack_s)))


def _counted(n: int, what: str) -> str:
    return f"{n} {what}" if n == 1 else f"{n} {what}s"


def _travel_mm(run: Run) -> float:
    """How far the circle's centre travels sideways, mm."""
    x = run.touch.x_mm[np.isfinite(run.touch.x_mm)]
    return float(np.ptp(x)) - 2 * (run.radius_mm or 0.0) if x.size else 0.0
