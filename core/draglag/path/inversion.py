"""A latency law inverted: when and where the stylus was."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from draglag.path.events import sample_interval_s
from draglag.path.local_fit import local_fit
from draglag.path.savgol import smoothed
from draglag.recording import FloatArray, IntArray

Law = Callable[[FloatArray], FloatArray]

STEP_S = 0.002  # of the equation: a quarter of the usual touch interval
GRID_S = 0.004  # of the stylus' own time: touch events are no closer
SPEED_HALF_S = 0.03  # half window of the shown speed: tremor, 8 to 12 Hz, re-times the trace and has to pass
POSITION_HALF_S = 0.05
JUMP_LAG_S = 0.08  # a drop of the lag by more than this within one event is no movement of a hand that could be seen
JUMP_SPEEDS = 1.2  # a jump is so much faster than what is before and after it
JUMP_NOISES = 7.0
NEIGHBOURS = 4  # events on either side of a jump, for speed and direction there
SETTLED_S = 0.03
USUAL_MM_S = 200.0  # where no speed is known


@dataclass(frozen=True)
class StylusPath:
    """The stylus' movement behind a touch trace, on an even grid (g,).

    ``arrival_s``: when the screen shows each point; ``event_t_s`` (n,): when the stylus was where an event shows it.
    """

    t_s: FloatArray
    xy_mm: FloatArray
    speed_mm_s: FloatArray
    arrival_s: FloatArray
    event_t_s: FloatArray

    def at(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Latency (m,), speed (m,) and position (m, 2) at times (m,)."""
        xy_mm = np.column_stack([np.interp(t_s, self.t_s, column) for column in self.xy_mm.T])
        latency_s = np.interp(t_s, self.t_s, self.arrival_s) - t_s
        return latency_s, np.interp(t_s, self.t_s, self.speed_mm_s), xy_mm


def stylus_path(
    t_s: FloatArray, xy_mm: FloatArray, law: Law, half_s: float = POSITION_HALF_S, own_s: FloatArray | None = None
) -> StylusPath:
    """The movement whose delayed image is the touch trace.

    Args:
        t_s: (n,) non-decreasing stamps, n > 1. xy_mm: (n, 2). half_s: half width of the smoothing window.
        own_s: (n,) result of ``shown_times_s``, if known.
    """
    own_s = shown_times_s(t_s, xy_mm, law) if own_s is None else own_s
    grid_s = np.arange(own_s[0], max(t_s[-1], own_s[0] + 8 * GRID_S), GRID_S)
    filled = _between(own_s, xy_mm, grid_s, GRID_S)
    smooth, velocity = (_smoothed(filled, half_s, GRID_S, order) for order in (0, 1))
    lag_s = np.interp(grid_s, own_s, t_s - own_s)
    return StylusPath(grid_s, smooth, np.hypot(velocity[:, 0], velocity[:, 1]), grid_s + lag_s, own_s)


def shown_times_s(t_s: FloatArray, xy_mm: FloatArray, law: Law) -> FloatArray:
    """When the stylus was where each event shows it, (n,), non-decreasing.

    With stylus speed v and shown speed w, the lag ℓ = L(v) obeys dℓ/dτ = 1 − w / v in the trace's time τ.
    """
    table = _table(law)
    if np.any(np.diff(table.lag_s) > 0):
        # Where a law rises its equation has no one answer: every event for itself.
        own_s = stylus_time_s(t_s, xy_mm, t_s, law, max(0.05, 4.5 * _interval_s(t_s)))
        return own_s if np.isfinite(own_s).all() else t_s - table.lag_at(USUAL_MM_S)
    noise_mm = _noise_mm(xy_mm)
    whole = [np.arange(t_s.size)]
    own_s = _followed(t_s, xy_mm, table, noise_mm, whole)
    breaks = _jumps(t_s, xy_mm, noise_mm)
    before = np.maximum(breaks - 1 - int(np.ceil(SPEED_HALF_S / _interval_s(t_s))), 0)
    far = [
        table.lag_after(lag_s, float(np.hypot(*(xy_mm[k] - xy_mm[k - 1])))) < lag_s - JUMP_LAG_S
        for k, lag_s in zip(breaks, (t_s - own_s)[before], strict=True)
    ]
    breaks = breaks[np.array(far, bool)]
    if breaks.size:
        own_s = _followed(t_s, xy_mm, table, noise_mm, np.split(whole[0], breaks))
    return own_s


def stylus_speed(law: Law, v_mm_s: FloatArray, a_mm_s2: FloatArray) -> FloatArray:
    """Speed (m,) of the stylus behind shown velocity and acceleration (m, 2).

    An event at t + L(v(t)) runs 1 + L′(v)·v̇ times slower than the stylus.
    """
    shown = np.maximum(np.hypot(v_mm_s[:, 0], v_mm_s[:, 1]), 1e-6)
    along = np.einsum("mk,mk->m", v_mm_s, a_mm_s2) / shown
    speed = shown
    for _ in range(3):
        speed = shown * (1 + slope_of(law, speed) * along).clip(0.6, 1.6)
    return speed


def slope_of(law: Law, speed_mm_s: FloatArray) -> FloatArray:
    """L′ over one mm/s about each speed (m,), s²/mm."""
    above, below = speed_mm_s + 0.5, np.maximum(speed_mm_s - 0.5, 0)
    upper, lower = law(np.concatenate([above, below])).reshape(2, -1)
    return np.asarray((upper - lower) / (above - below))


def stylus_time_s(t_s: FloatArray, xy_mm: FloatArray, at_s: FloatArray, law: Law, half_s: float) -> FloatArray:
    """at_s − L(v): when the stylus was where the trace shows it, non-decreasing, (m,); t_s and at_s increase."""
    fit = local_fit(t_s, xy_mm, at_s, half_s)
    latency_s = np.where(fit.ok, law(stylus_speed(law, fit.v_mm_s, fit.a_mm_s2)), np.nan)
    good = np.isfinite(latency_s)
    if not good.any():
        return np.full(at_s.shape, np.nan)
    latency_s = np.interp(at_s, at_s[good], latency_s[good])
    # A law that falls steeply can fold time where the stylus starts: both running extremes, averaged, are monotone.
    time_s = at_s - latency_s
    forward = np.maximum.accumulate(time_s)
    backward = np.minimum.accumulate(time_s[::-1])[::-1]
    return 0.5 * (forward + backward)


@dataclass(frozen=True)
class _Table:
    speed_mm_s: FloatArray
    lag_s: FloatArray
    lags: list[float]
    slownesses: list[float]

    def lag_at(self, speed_mm_s: float) -> float:
        return float(np.interp(speed_mm_s, self.speed_mm_s, self.lag_s))

    def speed_at(self, lag_s: float) -> float:
        return float(np.interp(-lag_s, -np.minimum.accumulate(self.lag_s), self.speed_mm_s))

    def lag_after(self, lag_s: float, distance_mm: float) -> float:
        """The lag after that distance at one moment: ∫ v dℓ is the distance."""
        ends = np.minimum(self.lag_s, lag_s)
        covered = np.append(0.0, np.cumsum(0.5 * (self.speed_mm_s[1:] + self.speed_mm_s[:-1]) * -np.diff(ends)))
        return float(np.interp(distance_mm, covered, ends))

    def follow(self, shown_mm_s: FloatArray, step_s: float, lag_s: float) -> FloatArray:
        """The lag at every step of a shown speed (g,)."""
        lags, slownesses = self.lags, self.slownesses
        last = len(lags) - 1
        out = []
        for shown in (step_s * shown_mm_s).tolist():
            target = lag_s + step_s
            low, high = 0, last
            while high - low > 1:
                middle = (low + high) // 2
                if lags[middle] + shown * slownesses[middle] > target:
                    low = middle
                else:
                    high = middle
            above, below = lags[low] + shown * slownesses[low], lags[high] + shown * slownesses[high]
            share = min(max((above - target) / (above - below), 0.0), 1.0) if above > below else 1.0
            lag_s = lags[low] + share * (lags[high] - lags[low])
            out.append(lag_s)
        return np.array(out)


def _table(law: Law) -> _Table:
    speed = np.geomspace(0.05, 1e4, 4096)
    lag_s = np.asarray(law(speed), float)
    return _Table(speed, lag_s, lag_s.tolist(), (1 / speed).tolist())


def _followed(t_s: FloatArray, xy_mm: FloatArray, table: _Table, noise_mm: float, pieces: list[IntArray]) -> FloatArray:
    own_s = np.empty(t_s.size)
    lag_s, before = 0.0, pieces[0][:0]
    for piece in pieces:
        at_s = np.arange(t_s[piece[0]], t_s[piece[-1]] + STEP_S, STEP_S)
        shown = _shown_speed(t_s[piece], xy_mm[piece], at_s, noise_mm)
        steady = float(np.median(shown[: round(SETTLED_S / STEP_S)]))
        if before.size:
            lag_s = min(_landed(xy_mm, before, piece, table, lag_s, noise_mm), table.lag_at(steady))
        else:
            lag_s = table.lag_at(steady)
        lags = np.append(lag_s, table.follow(shown[1:], STEP_S, lag_s))
        own_s[piece] = t_s[piece] - np.interp(t_s[piece], at_s, lags)
        lag_s, before = float(lags[-1]), piece
    return np.maximum.accumulate(own_s)


def _landed(
    xy_mm: FloatArray, before: IntArray, after: IntArray, table: _Table, lag_s: float, noise_mm: float
) -> float:
    """The lag after a jump of the trace, where L falls faster than time passes.

    With speeds v₁, v₂ at its ends, D the jump along the later movement and c the cosine of the turn,
    D = (L(v₁) − L(v₂)) · (c·v₁ + v₂) / 2 gives v₂.
    """
    jump = xy_mm[after[0]] - xy_mm[before[-1]]
    came = xy_mm[before[-1]] - xy_mm[before[-min(NEIGHBOURS, before.size)]]
    went = xy_mm[after[min(NEIGHBOURS, after.size) - 1]] - xy_mm[after[0]]
    size = float(np.hypot(*jump))
    seen = float(np.hypot(*went))
    ahead = went / seen if seen > 3 * noise_mm else jump / max(size, 1e-9)
    distance, turn = float(jump @ ahead), float(came @ ahead) / max(float(np.hypot(*came)), 3 * noise_mm, 1e-9)
    if distance < 0.3 * size:
        distance, turn = size, 0.0
    speed = table.speed_at(lag_s)
    covered = (lag_s - table.lag_s) * (speed * turn + table.speed_mm_s) / 2
    first = int(np.searchsorted(table.speed_mm_s, speed))
    enough = np.flatnonzero(covered[first:] >= distance)
    return min(lag_s, float(table.lag_s[first + enough[0]])) if enough.size else lag_s


def _jumps(t_s: FloatArray, xy_mm: FloatArray, noise_mm: float) -> IntArray:
    if t_s.size < 2 * NEIGHBOURS:
        return np.empty(0, np.int64)
    distance, dt_s = np.hypot(*np.diff(xy_mm, axis=0).T), np.maximum(np.diff(t_s), STEP_S / 2)
    near = NEIGHBOURS - 1
    padded = np.pad(distance / dt_s, near, mode="edge")
    medians = np.median(np.lib.stride_tricks.sliding_window_view(padded, near), axis=1)
    usual_mm = np.maximum(medians[: distance.size], medians[near + 1 : near + 1 + distance.size])
    return np.asarray(np.flatnonzero(distance > JUMP_SPEEDS * usual_mm * dt_s + JUMP_NOISES * noise_mm) + 1, np.int64)


def _shown_speed(t_s: FloatArray, xy_mm: FloatArray, at_s: FloatArray, noise_mm: float) -> FloatArray:
    """Speed of the trace, less what noise across the movement adds."""
    lasts_s = float(t_s[-1] - t_s[0])
    if lasts_s < 4 * STEP_S:
        return np.full(at_s.size, float(np.hypot(*(xy_mm[-1] - xy_mm[0]))) / lasts_s if lasts_s > 0 else 0.0)
    even = _between(t_s, xy_mm, at_s, 0.5 * STEP_S)
    dt_s = _interval_s(t_s)
    half_s = max(SPEED_HALF_S, 2.5 * dt_s)
    velocity = _smoothed(even, half_s, STEP_S, 1)
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    variance = 75 / 8 * noise_mm**2 * dt_s / (2 * half_s**3)  # of a local cubic's slope
    return np.asarray(np.maximum(speed - variance / (2 * np.maximum(speed, 1e-6)), 0.0))


def _interval_s(t_s: FloatArray) -> float:
    return max(sample_interval_s(t_s), STEP_S / 2)


def _noise_mm(xy_mm: FloatArray) -> float:
    if xy_mm.shape[0] < 8:
        return 0.0
    return float(np.sqrt(np.median(np.diff(xy_mm, 3, axis=0) ** 2) / 0.455 / 20))


def _between(t_s: FloatArray, xy_mm: FloatArray, at_s: FloatArray, moment_s: float) -> FloatArray:
    from scipy.interpolate import PchipInterpolator

    # Events of one moment are one event: their mean.
    _, group = np.unique(np.round((t_s - t_s[0]) / moment_s).astype(np.int64), return_inverse=True)
    count = np.bincount(group)
    x_mm, y_mm = (np.bincount(group, column) / count for column in xy_mm.T)
    if count.size < 2:
        return np.tile([x_mm[0], y_mm[0]], (at_s.size, 1))
    mean_s = np.bincount(group, t_s - t_s[0]) / count
    inside = np.clip(at_s - t_s[0], mean_s[0], mean_s[-1])
    return np.column_stack([PchipInterpolator(mean_s, column)(inside) for column in (x_mm, y_mm)])


def _smoothed(values: FloatArray, half_s: float, step_s: float, order: int) -> FloatArray:
    reach = min(max(3, round(half_s / step_s)), (values.shape[0] - 1) // 2)
    degree = min(3, 2 * reach)
    return smoothed(values, 2 * reach + 1, degree, order, step_s)
