"""An intermittent filter in the edges: a hidden Markov model of two latency levels."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from draglag.gap.fitting.joint import Fit
from draglag.gap.fitting.model import LawParameters, residual_mm, starting_law
from draglag.gap.fitting.signatures import view_of
from draglag.gap.fitting.state import term_signature, total
from draglag.gap.traces.edges import Placed
from draglag.recording import FloatArray
from draglag.simulation.effects.second_filter_mode.setting import By, Setting, within
from draglag.simulation.effects.second_filter_mode.skips import MOSTLY_ALIKE, largest_alike
from draglag.simulation.effects.second_filter_mode.unsure import state_variance
from draglag.simulation.effects.second_filter_mode.wandering import (
    FARTHEST,
    SCATTERS,
    Course,
    log_likelihood_of_wandering,
)

SIZES_S = np.geomspace(0.003, 0.04, 14)
ALIKE = 2  # of them on either side of the likeliest: another scatter may make another one the likeliest
STARTS = (0.1, 0.35, 0.65, 0.9)  # quantiles of a run's latencies that its earlier level is looked for at
DWELL_S = 4.0
LEAST_EDGES = 8
ROUNDS = 5
EDGE_MM, RUN_ERROR_S = 0.1, 3e-4
SLOWEST_MM_S = 25.0  # across the beam; slower, an edge does not constrain a latency
LAW_SD_S = 2e-3  # how well the law of a fit with most of the states right is known
LEVELS = 17
FAR_S = 0.2
EACH_SWITCH = 10.0  # deviance that a switch costs: where it is, among the edges of its run
LEAST_STAY_S = 3.0  # on average: shorter are stalls, or something that follows the path
LEAST_RUNS = 0.5  # of those of steady speed have to have a switch: otherwise it follows the speed


@dataclass(frozen=True)
class Switching:
    """Lateness; (n, 2) its session times from–to; gain in penalised deviance."""

    size_s: float
    on_s: FloatArray
    gain: float

    @property
    def setting(self) -> Setting:
        """Setting of the term."""
        return Setting(0.0, By.TIME, tuple(self.on_s.ravel().tolist()))


def find_switching(fit: Fit) -> Switching | None:
    """Best two-level latency; None if one level suffices."""
    placed, late_s, sd_s, usable = _latencies(fit)
    edges, steady = [], []
    for k, data in enumerate(fit.runs):
        own = np.flatnonzero(usable & (placed.run == k))
        if own.size >= LEAST_EDGES:
            edges.append(own[np.argsort(placed.since_start_s[own])])
            steady.append(data.steady)
    if not edges:
        return None
    courses = [(placed.since_start_s[own], late_s[own], sd_s[own]) for own in edges]
    likelihood, plain, all_later = _two_levels(courses)
    gains = 2 * (likelihood - plain[:, None]).sum(axis=0)
    states = [(placed.since_start_s[own], later[:, : own.size]) for own, later in zip(edges, all_later, strict=True)]
    best = int(np.argmax(gains))
    if gains[best] <= 0:
        return None
    spans = [span for t, later in states for span in _spans(t, later[best])]
    counts = np.array([np.count_nonzero(np.diff(later[best] > 0.5)) for _, later in states])
    switches = int(counts.sum())
    length_s = sum(float(t[-1] - t[0]) for t, _ in states)
    if not spans or length_s / (switches + len(states)) < LEAST_STAY_S:
        return None
    if not any(steady) or np.mean(counts[np.array(steady)] > 0) < LEAST_RUNS:
        return None
    if _alike_in_time(states, best) > MOSTLY_ALIKE:
        return None
    near_s = SIZES_S[max(best - ALIKE, 0) : best + ALIKE + 1]
    if log_likelihood_of_levels(courses, near_s) < log_likelihood_of_wandering(courses):
        return None
    return Switching(float(SIZES_S[best]), np.array(sorted(spans)), float(gains[best] - EACH_SWITCH * switches))


def _alike_in_time(states: list[tuple[FloatArray, FloatArray]], best: int) -> float:
    """Share of the switches about one time of a run: a latency that settles has one in each."""
    at = []
    for t, later in states:
        switched = np.flatnonzero(np.diff(later[best] > 0.5))
        at.append((0.5 * (t[switched] + t[switched + 1]) - t[0]) / (t[-1] - t[0]))
    return largest_alike(np.concatenate(at))


def log_likelihood_of_levels(courses: list[Course], sizes_s: FloatArray = SIZES_S) -> float:
    """Log-likelihood of two levels, at the likeliest size and scatter of them all."""
    n = sum(t_s.size for t_s, _, _ in courses)
    out = []
    for scatter in SCATTERS:
        likelihood, _, _ = _two_levels([(t_s, late_s, scatter * sd_s) for t_s, late_s, sd_s in courses], sizes_s)
        out.append(float(likelihood.sum(axis=0).max() - n * np.log(scatter)))
    return max(out)


def refine_times(fit: Fit, size_s: float, setting: Setting) -> Setting:
    """Times re-estimated by the law of a fit with the switching."""
    placed, late_s, sd_s, usable = _latencies(fit)
    late_s = late_s + size_s * within(setting.times_s, placed.since_start_s)
    spans = []
    for k in range(len(fit.runs)):
        own = np.flatnonzero(usable & (placed.run == k))
        if own.size < 2:
            continue
        own = own[np.argsort(placed.since_start_s[own])]
        t = placed.since_start_s[own]
        weight, stay = sd_s[own] ** -2, 0.5 * (1 + np.exp(-2 * np.diff(t) / DWELL_S))
        level = np.linspace(-0.6, 0.6, LEVELS) * abs(size_s)
        for _ in range(ROUNDS):
            off = [-0.5 * _square((late_s[own] - level[:, None] - s) / sd_s[own]) for s in (0.0, size_s)]
            likelihood, states = _forward_backward(off[0], off[1], stay)
            likelihood = likelihood - 0.5 * (level / LAW_SD_S) ** 2
            level = np.sum(weight * (late_s[own] - size_s * states), axis=1) / np.sum(weight)
        later = states[int(np.argmax(likelihood))]
        spans += _spans(t, later)
    return Setting(0.0, By.TIME, tuple(np.array(sorted(spans)).ravel().tolist()))


def later_of(placed: Placed, setting: Setting) -> np.ndarray:
    """Edges (m,) in the stretches of a filter undone in the traces."""
    return within(setting.times_s, placed.since_start_s + placed.latency_s)


def misassigned_s(fit: Fit, setting: Setting) -> tuple[float, ...]:
    """Stretches from–to in which edges contradict a filter undone in the traces, on the clock of its times."""
    placed, late_s, sd_s, usable = _latencies(fit)
    at_s = placed.since_start_s + placed.latency_s
    later = later_of(placed, setting)
    late_s = late_s + fit.terms[-1].sizes[0] * later  # what is fitted of it may be the mistaken ones'
    if_mistaken_s = setting.above * (1.0 - 2.0 * later)
    usable &= state_variance(placed, setting, setting.above) == 0
    out: list[tuple[float, float]] = []
    for k in range(len(fit.runs)):
        own = np.flatnonzero(usable & (placed.run == k))
        if own.size < LEAST_EDGES:
            continue
        own = own[np.argsort(at_s[own])]
        off = [-0.5 * _square((late_s[own] - s) / sd_s[own])[None] for s in (0.0, if_mistaken_s[own])]
        saved = 2 * (off[1] - off[0])[0]
        stay = 0.5 * (1 + np.exp(-2 * np.diff(at_s[own]) / DWELL_S))
        spans = _spans(at_s[own], _forward_backward(off[0], off[1], stay)[1][0])
        for begin_s, end_s in spans:
            if np.sum(saved[(at_s[own] > begin_s) & (at_s[own] < end_s)]) > EACH_SWITCH:
                out.append((begin_s, end_s))
    return tuple(np.array(out).ravel().tolist())


def law_from_levels(fit: Fit, plateau: bool) -> LawParameters:
    """Starting law through each run's level; runs' own estimates mix levels. Raises EstimateError."""
    placed, late_s, _, usable = _latencies(fit)
    less_s = np.zeros(len(fit.runs))
    for k, data in enumerate(fit.runs):
        own, e = usable & (placed.run == k), data.estimate
        if own.any() and e is not None and e.latency_s is not None and e.speed_mm_s is not None:
            level_s = float(fit.law(np.array([e.speed_mm_s]))[0] + np.median(late_s[own]))
            less_s[k] = e.latency_s - level_s
    return starting_law(fit.runs, less_s, plateau)


def _latencies(fit: Fit) -> tuple[Placed, FloatArray, FloatArray, np.ndarray]:
    """Placed edges, lateness relative to the fit, its standard deviation, whether usable."""
    placed = fit.placed
    lever = fit_lever(fit)
    variance = placed.touch_variance_mm2 + EDGE_MM**2 + (RUN_ERROR_S * lever) ** 2
    view = view_of(placed, fit.law, fit.geometry, fit.width_mm)
    offsets = total(tuple(term_signature(t, view) for t in fit.terms), fit.terms, view, "offset")
    left_mm = residual_mm(placed, fit.geometry) - offsets
    usable = placed.ok & np.isfinite(left_mm) & (np.abs(lever) > SLOWEST_MM_S)
    with np.errstate(divide="ignore", invalid="ignore"):
        late_s, sd_s = left_mm / lever, np.sqrt(variance) / np.abs(lever)
    return placed, late_s, sd_s, usable & (np.abs(late_s) < FAR_S)


def fit_lever(fit: Fit) -> FloatArray:
    """Change of placed edges' residuals with latency, mm/s."""
    placed = fit.placed
    across = placed.v_mm_s[:, 1] - fit.geometry.slope * placed.v_mm_s[:, 0]
    return np.asarray(-across * placed.stretch)


def _two_levels(runs: list[Course], sizes_s: FloatArray = SIZES_S) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Log-likelihood of two levels (runs, sizes), of one (runs,), and probability of the later level (runs, sizes, m of
    the longest run).
    """
    longest = max(t_s.size for t_s, _, _ in runs)
    t_s, late_s, sd_s = np.zeros((3, len(runs), longest))
    sd_s += np.inf
    for k, run in enumerate(runs):
        n = run[0].size
        t_s[k, :n], late_s[k, :n], sd_s[k, :n] = run
        t_s[k, n:] = run[0][-1]
    weight = sd_s**-2
    one = np.sum(weight * late_s, axis=1) / np.sum(weight, axis=1)
    plain = -0.5 * np.sum(_square((late_s - one[:, None]) / sd_s), axis=1)
    starts = np.array([np.quantile(run[1], STARTS) for run in runs])
    level = np.repeat(starts[:, None, :], sizes_s.size, axis=1)
    late, sd, weight = (values[:, None, None, :] for values in (late_s, sd_s, weight))
    size = sizes_s[:, None]
    stay = 0.5 * (1 + np.exp(-2 * np.diff(t_s) / DWELL_S))[:, None, None, :]
    later = np.zeros((*level.shape, longest))
    likelihood = np.full(level.shape, -np.inf)
    for _ in range(ROUNDS):
        off = [-0.5 * _square((late - (level + s)[..., None]) / sd) for s in (0.0, size)]
        likelihood, later = _forward_backward(off[0], off[1], stay)
        level = np.sum(weight * (late - later * size[..., None]), axis=-1) / np.sum(weight, axis=-1)
    pick = np.argmax(likelihood, axis=2)[:, :, None]
    best = np.take_along_axis(likelihood, pick, axis=2)[:, :, 0]
    return best, plain, np.take_along_axis(later, pick[..., None], axis=2)[:, :, 0]


def _square(z: FloatArray) -> FloatArray:
    return np.minimum(z**2, FARTHEST)


def _forward_backward(zero: FloatArray, one: FloatArray, stay: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Log-likelihood (...) and posterior of state one (..., m). stay: (..., m − 1) probability that a state lasts."""
    m = zero.shape[-1]
    top = np.maximum(zero, one)
    density = np.moveaxis(np.stack([np.exp(zero - top), np.exp(one - top)]), -1, 0).copy()
    forward = np.empty((m, 2, *zero.shape[:-1]))
    scale = np.empty((m, *zero.shape[:-1]))
    now = 0.5 * density[0]
    for i in range(m):
        if i:
            p = stay[..., i - 1]
            now = (p * now + (1 - p) * now[::-1]) * density[i]
        scale[i] = now[0] + now[1]
        now = now / scale[i]
        forward[i] = now
    later = np.empty((m, *zero.shape[:-1]))
    backward = np.ones_like(now)
    for i in range(m - 1, -1, -1):
        both = forward[i] * backward
        later[i] = both[1] / (both[0] + both[1])
        if i:
            p = stay[..., i - 1]
            ahead = backward * density[i]
            backward = (p * ahead + (1 - p) * ahead[::-1]) / scale[i]
    return np.log(scale).sum(axis=0) + top.sum(axis=-1), np.moveaxis(later, 0, -1)


def _spans(t_s: FloatArray, later: FloatArray) -> list[tuple[float, float]]:
    """Session times from–to of the later state."""
    on = later > 0.5
    changes = np.flatnonzero(np.diff(on)) + 1
    bounds = [0, *changes.tolist(), t_s.size]
    out = []
    for first, last in pairwise(bounds):
        if on[first]:
            begin = 0.5 * (t_s[first - 1] + t_s[first]) if first else t_s[0] - 0.5
            end = 0.5 * (t_s[last - 1] + t_s[last]) if last < t_s.size else t_s[-1] + 0.5
            out.append((float(begin), float(end)))
    return out
