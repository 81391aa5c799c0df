"""Undoing of sample-and-hold.

At tick j the newest frame has age p_f · frac(α j − φ): p_f frame period, α fraction of p_t / p_f, φ the run's phase.
Positions lag by age × speed; α is a common line of the runs' spectra.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from draglag.gap.streams.stamps import first_of_repeats
from draglag.path.local_fit import local_fit
from draglag.path.savgol import smoothed
from draglag.recording import FloatArray, IntArray, TouchTrace
from draglag.simulation.effects.sample_hold.ages import uneven_age_s

WINDOW, DEGREE = 17, 3  # ticks of the local path
SLOWEST = 0.06  # turns a tick: a slower beat is taken for the path's own
LINES = 4  # of the spectrum that are tried
GRID = 1 << 16
PHASES = np.arange(64) / 64
IN_STEP = 4  # frames a tick, halves, thirds and quarters of one
FASTEST = 6  # runs that determine α: the faster, the less a position's noise is in time
NEAR_JUMP = 0.2  # of a turn: a jump may come so much sooner or later
LEAST_GAIN = 0.25
"""Share of the fast runs' deviations that the sawtooth has to explain. Calibrated: frames that keep their phase give
0.62 to 0.93 (13 sessions of four generators), frames whose jitter adds up, that are lost in bursts or come twice a tick
at most 0.22 in the median run (four sessions): ages are then wrong for many events in a row, which no window
averages."""
HEIGHT = (0.45, 1.1)  # of the frames' period, that a sawtooth may seem to have: frames that jitter blur its jumps


@dataclass(frozen=True)
class _Deviation:
    """One run's events, (n,): tick, time ahead of the path, weight."""

    tick: IntArray
    ahead_s: FloatArray
    weight: FloatArray


def undo_sample_hold(touches: Sequence[TouchTrace], period_s: float) -> list[TouchTrace] | None:
    """Traces without repeats, with all positions of the mean age; None if the beat cannot be seen.

    touches: with their repeats, for first showings alone leave the phase of a faster loop open. period_s: of the loop.
    """
    deviations = [_deviation(touch, period_s) for touch in touches]
    fast = sorted((d for d in deviations if d is not None), key=lambda d: -float(d.weight.mean()))[:FASTEST]
    if not fast:
        return None
    alpha = _turns_a_tick(fast)
    parts = np.arange(1, IN_STEP + 1)
    if float(np.min(np.abs(parts * alpha - np.round(parts * alpha)))) * min(run.tick[-1] for run in fast) < 1:
        return None  # loop and frames keep step: which ages take turns does not show
    best = [_sawtooth(run, alpha) for run in fast]
    if float(np.median([fit.share for fit in best])) < LEAST_GAIN:
        return None
    # The sawtooth's height is the frames' period, of which only p_t / (n + α) are possible; jitter makes it look lower.
    height_s = float(np.median([fit.height_s for fit in best]))
    possible_s = period_s / (np.arange(6) + alpha)
    candidates_s = possible_s[(HEIGHT[0] * possible_s < height_s) & (height_s < HEIGHT[1] * possible_s)]
    fits = [None if d is None else _sawtooth(d, alpha) for d in deviations]
    first = [first_of_repeats(touch) for touch in touches]
    tried = [_at_even_ages(first, fits, alpha, period_s, float(frame_s)) for frame_s in candidates_s]
    return min(tried, key=uneven_age_s) if len(tried) > 1 else next(iter(tried), None)


def _at_even_ages(
    touches: Sequence[TouchTrace], fits: Sequence[_Fit | None], alpha: float, period_s: float, frame_s: float
) -> list[TouchTrace]:
    out = []
    # In a faster loop no first event is older than a period: ages are taken about the middle of those.
    spare = 0.5 * max(1 - period_s / frame_s, 0.0)
    for touch, fit in zip(touches, fits, strict=True):
        if fit is None:
            out.append(touch)
            continue
        turns = np.mod(alpha * _ticks(touch.t_s, period_s) - fit.phase + spare, 1.0)
        turns = _jumped(touch, turns, frame_s, 8 * period_s)
        turns[0] += spare > turns[0]  # nobody saw whether it repeats one before
        age_s = frame_s * (turns - spare)
        # Less half a frame, not less the run's own mean: where loop and frames nearly keep step, that differs by run.
        own_s = touch.t_s - (age_s - 0.5 * frame_s)
        if frame_s > period_s:
            # A loop faster than the frames writes every one of them: at their own times they are even.
            own_s = np.maximum.accumulate(own_s + 1e-9 * np.arange(own_s.size))
            out.append(replace(touch, t_s=own_s))
        else:
            out.append(_as_of(touch, own_s, 4 * period_s))
    return out


def _jumped(touch: TouchTrace, turns: FloatArray, frame_s: float, half_width_s: float) -> FloatArray:
    """Ages (n,), in frames from where they jump, that jump where positions show it, up to a tick off."""
    own_s = np.maximum.accumulate(touch.t_s - frame_s * turns + 1e-9 * np.arange(turns.size))
    xy = np.column_stack([touch.x_mm, touch.y_mm])
    fit = local_fit(own_s, xy, own_s, half_width_s)
    ahead_s = np.sum((xy - fit.xy_mm) * fit.v_mm_s, axis=1) / np.maximum(fit.speed_mm_s, 1e-6) ** 2
    fresh = fit.ok & (turns > 1 - NEAR_JUMP) & (ahead_s > 0.5 * frame_s)
    old = fit.ok & (turns < NEAR_JUMP) & (ahead_s < -0.5 * frame_s)
    return np.asarray(turns + old - fresh, float)


def _as_of(touch: TouchTrace, own_s: FloatArray, half_width_s: float) -> TouchTrace:
    """Positions of ``own_s`` moved along the path to their stamps; those without a path left out."""
    xy = np.column_stack([touch.x_mm, touch.y_mm])
    there, here = (local_fit(own_s, xy, at_s, half_width_s) for at_s in (touch.t_s, own_s))
    keep = there.ok & here.ok
    xy = (xy + there.xy_mm - here.xy_mm)[keep]
    ids = touch.contact_id[keep] if touch.contact_id.size == keep.size else touch.contact_id
    return TouchTrace(touch.t_s[keep], xy[:, 0], xy[:, 1], ids, gaps_s=touch.gaps_s)


def _ticks(t_s: FloatArray, period_s: float) -> IntArray:
    return np.asarray(np.concatenate([[0], np.cumsum(np.round(np.diff(t_s) / period_s))]), np.int64)


def _deviation(touch: TouchTrace, period_s: float) -> _Deviation | None:
    """Deviation from a local path; None for a short run."""
    if touch.t_s.size < 10 * WINDOW:
        return None
    tick = _ticks(touch.t_s, period_s)
    xy = _at_every_tick(tick, np.column_stack([touch.x_mm, touch.y_mm]))
    smooth = smoothed(xy, WINDOW, DEGREE)[tick]
    velocity = smoothed(xy, WINDOW, DEGREE, 1, period_s)[tick]
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    off = np.column_stack([touch.x_mm, touch.y_mm]) - smooth
    moving = speed > 0.3 * np.median(speed)
    ahead_s = np.where(moving, np.sum(off * velocity, axis=1) / np.maximum(speed, 1e-6) ** 2, 0.0)
    # The jumps of a slow beat are few, far beyond the median, and no outliers.
    limit = max(6 * 1.4826 * float(np.median(np.abs(ahead_s))), period_s)
    return _Deviation(tick, np.clip(ahead_s, -limit, limit), np.where(moving, speed**2, 0.0))


def _at_every_tick(tick: IntArray, values: FloatArray) -> FloatArray:
    """Values (n, k) of some ticks, linear in between."""
    at = np.arange(tick[-1] + 1)
    before = np.searchsorted(tick, at, side="right") - 1
    after = np.minimum(before + 1, tick.size - 1)
    share = (at - tick[before]) / np.maximum(tick[after] - tick[before], 1)
    return np.asarray(values[before] + share[:, None] * (values[after] - values[before]))


def _turns_a_tick(fast: Sequence[_Deviation]) -> float:
    """α from fast runs. A spectral line may be that of a mirror image or a multiple of α."""
    best: tuple[float, list[float]] = (-np.inf, [0.5])
    beats = _beats(fast)
    lines = [np.array([_finer(run, line) for run in fast]) for line in beats]
    turns = [one for line in lines for one in (line, line / 2, (line + 1) / 2)]
    # Neighbouring multiples of a slow α lie α apart.
    spacing = float(np.min(np.diff(np.sort(beats))))
    slow = [lines[0] / round(beats[0] / one) for one in (spacing, spacing / 2) if one < SLOWEST]
    for alphas in (side for one in (*turns, *slow) for side in (one, 1 - one)):
        pairs = zip(fast[:2], alphas[:2], strict=True)
        share = float(np.mean([_sawtooth(run, float(alpha), PHASES[::2]).share for run, alpha in pairs]))
        best = max(best, (share, [float(alpha) for alpha in alphas]))
    return float(np.median(best[1]))


def _beats(runs: Sequence[_Deviation]) -> list[float]:
    """α of each line that runs share."""
    from scipy.ndimage import maximum_filter1d

    power = np.zeros(GRID)
    widest = 1
    for run in runs:
        even = np.zeros(GRID)
        inside = run.tick < GRID
        even[run.tick[inside]] = (run.weight * run.ahead_s)[inside]
        spectrum = np.abs(np.fft.fft(even)) ** 2
        # Runs of another length have lines of another width: the best power within a run's own resolution.
        reach = max(1, round(GRID / run.tick[-1]))
        power += maximum_filter1d(spectrum, 2 * reach + 1, mode="wrap") / np.median(spectrum)
        widest = max(widest, reach)
    alpha = np.arange(GRID) / GRID
    power[(alpha < SLOWEST) | (alpha > 0.5)] = 0.0  # deviations are real: the other half is the same
    lines = []
    for _ in range(LINES):
        k = int(np.argmax(power))
        lines.append(float(alpha[k]))
        power[max(k - 4 * widest, 0) : k + 4 * widest + 1] = 0.0
    return lines


def _finer(run: _Deviation, near: float) -> float:
    """α of one run, near the shared one."""
    alphas = near + 0.1 / run.tick[-1] * np.arange(-20, 21)
    lines = [np.abs(np.exp(-2j * np.pi * one * run.tick) @ (run.weight * run.ahead_s)) for one in alphas]
    return float(alphas[int(np.argmax(lines))])


@dataclass(frozen=True)
class _Fit:
    phase: float
    height_s: float
    share: float


def _sawtooth(run: _Deviation, alpha: float, phases: FloatArray = PHASES) -> _Fit:
    """Best sawtooth and the share it explains."""
    age = np.mod(alpha * run.tick[:, None] - phases, 1.0)
    even = _at_every_tick(run.tick, age)
    sawtooth = smoothed(even, WINDOW, DEGREE)[run.tick] - age  # as the deviations were taken
    moment = (run.weight * run.ahead_s) @ sawtooth
    size = run.weight @ sawtooth**2
    gain = np.where(moment > 0, moment**2 / size, 0.0) / float(np.sum(run.weight * run.ahead_s**2))
    k = int(np.argmax(gain))
    return _Fit(float(phases[k]), float(moment[k] / size[k]), float(gain[k]))
