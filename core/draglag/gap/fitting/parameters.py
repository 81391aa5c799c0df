"""An accepted term's numbers in the effect's own parameters, with 95 % intervals and where it acts."""

from __future__ import annotations

import numpy as np

from draglag.gap.fitting.joint import Fit
from draglag.gap.fitting.model import base_prior
from draglag.gap.fitting.noise import SPEED_TIMING_S
from draglag.gap.fitting.plateau import plateau_ci95_mm_s
from draglag.gap.fitting.run_by_run import run_by_run_sd
from draglag.gap.fitting.state import ACCEL_UNKNOWN, SHOWN, Term, shown_in_trace, term_signature
from draglag.gap.traces.skips import change_behind
from draglag.simulation.effects import column_of, effect_class
from draglag.simulation.effects.spatial_warp import CYCLES

WARP = "spatial_warp"
WITHIN = 3.84  # of the deviance of the best: not excluded at 95 %
ELSEWHERE = 0.2  # of a bend: runs show it on the beam's line only; generated ones were up to 0.17 larger elsewhere
SMOOTHED = 1.4  # a change of speed reads less or more as a panel smooths it
SWITCH_UNKNOWN = 0.01  # of a lateness: when exactly, between two events, it comes and goes
SKIP_UNKNOWN = 0.03  # of a lateness: the touch events' rate in time, their speed beside a skip
Parameters = dict[str, tuple[float, tuple[float, float]]]


def whole_sizes(term: Term, fit: Fit) -> np.ndarray:
    """A term's sizes (k,) across the beam, with what was undone of it in the traces or asked of the law itself."""
    lattice = fit.runs[0].lattice
    if term.effect == "pitch_ripple" and lattice is not None:
        return np.array(term.sizes) + lattice.sizes_mm[:, 1]
    if term.effect == "lagging_law" and len(term.theta) == 2:
        return np.array(term.sizes) + term.theta[1]
    if shown_in_trace(term):
        return np.array(term.sizes) + term.theta[0]
    if term.effect == "smoothing_shrink" and term.theta:
        return np.array(term.sizes) + term.theta[0] ** 2
    return np.array(term.sizes)


def parameters_of(effect: str, fit: Fit) -> Parameters:
    """Sizes of an effect in a fit, in the units of its class in the simulation."""
    if effect == "low_speed_plateau":
        return {"speed_mm_s": (fit.law.plateau_mm_s, plateau_ci95_mm_s(fit))}
    term_id = column_of(effect)
    at = base_prior(fit.law).size
    for term in fit.terms:
        k = len(term.sizes)
        if term.effect == term_id:
            own = slice(at, at + k)
            return _named(effect, fit, whole_sizes(term, fit), own, term.theta)
        at += k
    return {}


def _named(effect: str, fit: Fit, sizes: np.ndarray, own: slice, theta: tuple[float, ...]) -> Parameters:
    """``own``: which of the fit's columns are the term's."""
    se = np.maximum(np.sqrt(np.maximum(np.diag(fit.covariance)[own], 0)), run_by_run_sd(fit)[own])
    known = effect_class(effect)
    if known.size_is_the_term_s:
        name, factor = known.parameters[0].name, known.per_term
        # What no number of edges averages away: of which moment a speed is, and how smooth an acceleration.
        systematic = {
            "lagging_law": np.hypot(SPEED_TIMING_S, ACCEL_UNKNOWN * sizes[0]),
            "acceleration_lag": ACCEL_UNKNOWN * abs(sizes[0]),
        }
        se[0] = np.hypot(se[0], systematic.get(effect, 0.0))
        if effect == "second_filter_mode" and theta[1:2] == (SHOWN,):
            # Known from the touch events' skips too; few edges may lie in its stretches, or none.
            skips_s = SKIP_UNKNOWN * theta[0]
            se[0] = skips_s if se[0] == 0 else 1 / np.hypot(1 / se[0], 1 / skips_s)
            se[0] = np.hypot(se[0], SWITCH_UNKNOWN * theta[0])
        value, reach = factor * sizes[0], abs(factor) * 1.96 * se[0]
        out: Parameters = {name: (float(value), (float(value - reach), float(value + reach)))}
        if effect == "second_filter_mode" and theta and theta[1] < 2:
            unit = "threshold_mm_s2" if theta[1] else "threshold_mm_s"
            out[unit] = (theta[0], (0.8 * theta[0], 1.25 * theta[0]))
        change = _change_behind(fit) if effect == "second_filter_mode" else None
        if change is not None:
            out["threshold_mm_s2"] = (change, (change / SMOOTHED, change * SMOOTHED))
        return out
    if effect == "scale_error":
        diameter = fit.geometry.diameter_mm
        # A screen that reads large by a share shows the disc large by the same share.
        value, reach = sizes[0] / diameter, 1.96 * se[0] / diameter
        return {"share": (float(value), (float(value - reach), float(value + reach)))}
    if effect == "smoothing_shrink":
        low, high = (float(np.sqrt(max(sizes[0] + s * 1.96 * se[0], 0.0))) for s in (-1, 1))
        return {"time_constant_s": (float(np.sqrt(max(sizes[0], 0.0))), (low, high))}
    # A sine and a cosine, or a polynomial: the amplitude over the panel.
    wave = bool(theta) and theta[0] > 0
    if wave:
        amplitude = float(np.hypot(*sizes[:2]))
        lattice = fit.runs[0].lattice
        if lattice is not None:
            # Edges lie on one line across; what ripples with y alone is seen by the touch events only.
            amplitude = max(amplitude, float(np.hypot(*lattice.sizes_mm[2:, 1])))
    else:
        x = fit.view.panel_x
        shape = np.column_stack([x**k for k in range(2, 2 + sizes.size)]) @ sizes
        amplitude = 0.5 * float(np.ptp(shape - np.polyval(np.polyfit(x, shape, 1), x)))
    reach = 1.96 * float(np.max(se[:2])) if wave else 0.3 * amplitude
    low, high = max(amplitude - reach, 0.0), amplitude + reach
    if effect == WARP:
        ends = np.array([(low, high), *_amplitudes_alike(fit, sizes, own)])
        low, high = float(ends[:, 0].min() / (1 + ELSEWHERE)), float(ends[:, 1].max() * (1 + ELSEWHERE))
    out = {"amplitude_mm": (amplitude, (low, high))}
    if effect == "pitch_ripple" and theta:
        out["pitch_mm"] = (theta[0], (theta[0] * 0.985, theta[0] * 1.015))
    return out


def _amplitudes_alike(fit: Fit, sizes: np.ndarray, own: slice) -> list[tuple[float, float]]:
    """Intervals of a bend's amplitude with every number of cycles that the edges do not exclude. Where runs cover a
    part of the panel, a wide wave and a narrow one of very different amplitudes bend that part alike."""
    waves = [term_signature(Term(WARP, (float(cycles),)), fit.view).columns(fit.view) for cycles in CYCLES]
    others = np.delete(fit.design, own, axis=1)
    target = fit.residual_mm + fit.design[:, own] @ sizes
    white = fit.whiteners[fit.best].apply(np.column_stack([others, *waves, target]))
    prior = np.diag(np.append(np.delete(fit.prior, own), [1e-12] * 2))
    p, found = others.shape[1], []
    for k in range(CYCLES.size):
        a = np.column_stack([white[:, :p], white[:, p + 2 * k : p + 2 * k + 2]])
        spread = np.linalg.pinv(a.T @ a + prior, hermitian=True)
        moment = a.T @ white[:, -1]
        amplitude, reach = np.hypot(*(spread @ moment)[-2:]), 1.96 * np.sqrt(np.diag(spread)[-2:].max())
        found.append((float(moment @ spread @ moment), float(amplitude - reach), float(amplitude + reach)))
    best = max(gain for gain, _, _ in found)
    return [(max(low, 0.0), high) for gain, low, high in found if gain > best - WITHIN]


def _change_behind(fit: Fit) -> float | None:
    """Above which change of speed, mm/s², a second filter is there that the touch events show, if that is what it
    follows."""
    times = next((t.theta[2:] for t in fit.terms if shown_in_trace(t)), None)
    return None if times is None else change_behind(fit.runs, times)


def where_of(effect: str, fit: Fit) -> str:
    """Where the effect acts, in words."""
    if effect == "low_speed_plateau":
        return f"drag speed below {fit.law.plateau_mm_s:.0f} mm/s"
    times = next((t.theta[2:] for t in fit.terms if t.effect == effect == "second_filter_mode"), ())
    if times:
        change = _change_behind(fit)
        cause = "" if change is None else f", as a rule where the speed changes by more than {change:.0f} mm/s²"
        return f"in {len(times) // 2} stretches of time, {sum(times[1::2]) - sum(times[::2]):.0f} s in all{cause}"
    return effect_class(effect).where
