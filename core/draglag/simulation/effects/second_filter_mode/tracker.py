"""Kalman filter of constant speed and turn with two levels of lateness; beam search over switches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from draglag.recording import FloatArray

if TYPE_CHECKING:
    from draglag.gap.traces.run_data import RunData

HISTORIES = 8  # three times as many give the same
SWITCH = 5.0  # log-likelihood that a switch costs
OUTLIER = 200.0  # squared standard deviations; beyond it an event moves no tracker, but for too many of them
# (with 50, skips of 2 of 26 kept runs are lost)
LOST = 4  # outliers in a row after which it restarts
FAR = 1e9  # what no switch is worth
TURN_S, FASTEST_TURN = 0.05, 60.0  # rad/s: 1 m/s on a circle of 17 mm
STEADY = 31  # events over which a speed is the median: skips are fewer than half
LEAST_WAY_MM = 1.5  # over which a direction is known


@dataclass(frozen=True)
class Tracks:
    """Events of all runs, (n, runs): complex positions, turn rate (rad/s), turn and way to the next."""

    t_s: FloatArray
    z_mm: np.ndarray
    live: np.ndarray
    rate: FloatArray
    turn: np.ndarray
    way_s: np.ndarray


def stack_runs(runs: Sequence[RunData]) -> Tracks:
    """Runs padded to the longest with events of no weight."""
    n = max(data.t_s.size for data in runs)
    shape = n, len(runs)
    t_s, z_mm, live, rate = np.zeros(shape), np.zeros(shape, complex), np.zeros(shape, bool), np.zeros(shape)
    for k, data in enumerate(runs):
        m = data.t_s.size
        t_s[:m, k], z_mm[:m, k], live[:m, k] = data.t_s, data.xy_mm @ np.array([1, 1j]), True
        t_s[m:, k], z_mm[m:, k] = data.t_s[-1], z_mm[m - 1, k]
        rate[:m, k] = _turn_rate(data.t_s, z_mm[:m, k])
    apart_s = np.minimum(np.diff(t_s, axis=0), 0.05)
    return Tracks(t_s, z_mm, live, rate, np.exp(1j * rate[1:] * apart_s), _way_s(rate[1:], apart_s))


def _way_s(rate: FloatArray, apart_s: FloatArray | float) -> np.ndarray:
    """Way over velocity."""
    angle = rate * apart_s
    small = np.abs(angle) < 1e-6
    return np.asarray(apart_s * np.where(small, 1.0, np.expm1(1j * angle) / np.where(small, 1.0, 1j * angle)))


def _turn_rate(t_s: FloatArray, z_mm: np.ndarray) -> FloatArray:
    """Turn rate, (n,) rad/s; 0 where unknown."""
    from scipy.ndimage import median_filter

    first = np.searchsorted(t_s, t_s - TURN_S)
    last = np.minimum(np.searchsorted(t_s, t_s + TURN_S), t_s.size - 1)
    before, after = z_mm - z_mm[first], z_mm[last] - z_mm
    known = (np.abs(before) > LEAST_WAY_MM) & (np.abs(after) > LEAST_WAY_MM)
    # The curvature is the path's, whatever the trace skips on it; the speed is that between two skips.
    way_mm, apart_s = np.abs(np.diff(z_mm)), np.maximum(np.diff(t_s), 1e-4)
    speed = median_filter(way_mm / apart_s, STEADY)
    speed = np.append(speed, speed[-1])
    rate = np.angle(after * np.conj(before)) / np.maximum(0.5 * (np.abs(before) + np.abs(after)), 1e-3) * speed
    summed = np.concatenate([[0.0], np.cumsum(np.where(known, rate.clip(-FASTEST_TURN, FASTEST_TURN), 0.0))])
    return np.asarray((summed[last + 1] - summed[first]) / (last + 1 - first))


def track(tracks: Tracks, gains: FloatArray) -> tuple[FloatArray, FloatArray]:
    """One level of lateness: log-likelihood (runs, g), squared innovations (n − 1, runs, g).

    gains: ``tracker_gains``.
    """
    shape = gains.shape[2:]
    p, shown = np.broadcast_to(tracks.z_mm[0][:, None], shape).astype(complex), _shown_velocity(tracks)
    v = np.broadcast_to(shown[0][:, None], shape).astype(complex)
    lost = np.zeros(shape, int)
    left = np.empty((gains.shape[0], *shape))
    way_s, turn, z_mm, shown = (a[..., None] for a in (tracks.way_s, tracks.turn, tracks.z_mm, shown))
    for i, (of_p, of_v, of_off) in enumerate(gains):
        p, v = p + v * way_s[i], v * turn[i]
        off = z_mm[i + 1] - p
        left[i] = (off.real**2 + off.imag**2) / of_off
        p, v, lost = _corrected(p, v, lost, off, left[i], (of_p, of_v, shown[i]))
    cost = np.minimum(left, OUTLIER) + np.log(gains[:, 2])
    return -0.5 * np.sum(cost * tracks.live[1:, :, None], axis=0), left


def _corrected(
    p: np.ndarray,
    v: np.ndarray,
    lost: np.ndarray,
    off: np.ndarray,
    square: FloatArray,
    gains: tuple[FloatArray, FloatArray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, velocities and outliers in a row after an event. gains: of both, and the velocity after a restart."""
    of_p, of_v, shown = gains
    out = square > OUTLIER
    if not out.any():
        return p + of_p * off, v + of_v * off, np.zeros_like(lost)
    restart = out & (lost >= LOST)
    p = p + np.where(restart, 1.0, np.where(out, 0.0, of_p)) * off
    v = np.where(restart, shown, v + np.where(out, 0.0, of_v) * off)
    return p, v, np.where(out & ~restart, lost + 1, 0)


def track_histories(tracks: Tracks, size_s: float, gains: FloatArray) -> tuple[FloatArray, np.ndarray]:
    """Likeliest history of two levels of lateness: log-likelihood (runs, g), states (n, runs, g).

    size_s: lateness. gains: ``tracker_gains``.
    """
    n, runs = tracks.t_s.shape
    shape = runs, gains.shape[3], HISTORIES
    p = np.broadcast_to(tracks.z_mm[0][:, None, None], shape).astype(complex)
    shown = _shown_velocity(tracks)
    v = np.broadcast_to(shown[0][:, None, None], shape).astype(complex)
    late = np.zeros(shape, bool)
    late[..., 1:2] = True
    p = np.where(late, p + v * _way_s(tracks.rate[0], size_s)[:, None, None], p)
    # A run that stays in one state does not show which: the usual one.
    value = np.full(shape, -FAR)
    value[..., 0], value[..., 1:2] = 0.0, -SWITCH
    lost = np.zeros(shape, int)
    parents, states = np.empty((n - 1, *shape), np.int8), np.empty((n - 1, *shape), bool)
    back_s = _way_s(-tracks.rate[1:], size_s)
    # Where the histories of each tracker begin in a flat array: ``take`` there costs a fifth of ``take_along_axis``.
    begin = HISTORIES * np.arange(runs * shape[1]).reshape(*shape[:2], 1)
    of_p, of_v, of_off = (gains[:, k, ..., None] for k in range(3))
    way_s, turn, back_s, shown = (a[..., None, None] for a in (tracks.way_s, tracks.turn, back_s, shown))
    z_mm, live = tracks.z_mm[..., None, None], tracks.live[..., None, None, None]
    penalty = np.array([0.0, SWITCH])
    off = np.empty((*shape, 2), complex)  # if it stays, if it switches
    for i in range(n - 1):
        p, v = p + v * way_s[i], v * turn[i]
        now = z_mm[i + 1] - p
        then = now + v * back_s[i]
        off[..., 0], off[..., 1] = np.where(late, then, now), np.where(late, now, then)
        square = (off.real**2 + off.imag**2) / of_off[i, ..., None]
        cost = 0.5 * np.minimum(square, OUTLIER) * live[i + 1] + penalty
        each = (value[..., None] - cost).reshape(*shape[:2], -1)
        order = np.argsort(-each, axis=-1)[..., :HISTORIES]
        parent = order // 2
        value, kept, square = (a.take(2 * begin + order) for a in (each, off, square))
        p, v, lost, late = (a.take(begin + parent) for a in (p, v, lost, late))
        late = late ^ (order % 2 == 1)
        p, v, lost = _corrected(p, v, lost, kept, square, (of_p[i], of_v[i], shown[i]))
        parents[i], states[i] = parent, late
    spread = np.sum(np.log(gains[:, 2]) * tracks.live[1:, :, None], axis=0)
    return value[..., 0] - 0.5 * spread, _history(parents, states)


def _shown_velocity(tracks: Tracks) -> np.ndarray:
    """Initial velocities, (n − 1, runs) mm/s."""
    event = np.arange(1, tracks.t_s.shape[0])
    first = np.minimum(np.maximum(event - LOST, 0), tracks.t_s.shape[0] - 1 - LOST)
    last = np.maximum(event, LOST)
    mean = (tracks.z_mm[last] - tracks.z_mm[first]) / np.maximum(tracks.t_s[last] - tracks.t_s[first], 1e-4)
    return np.asarray(mean * tracks.turn ** (LOST / 2))  # that of half as many events ago


def tracker_gains(tracks: Tracks, noise_mm: FloatArray, unsteady: FloatArray) -> FloatArray:
    """Gains of position and velocity, variance of an innovation; (n − 1, 3, runs, g).

    noise_mm: (runs, g) of one event. unsteady: (runs, g) power of a random acceleration, mm²/s³.
    """
    noise = 2 * noise_mm**2
    pp, pv, vv = noise, np.zeros(unsteady.shape), np.full(unsteady.shape, 1e5)
    out = np.empty((tracks.t_s.shape[0] - 1, 3, *unsteady.shape))
    d = np.minimum(np.diff(tracks.t_s, axis=0), 0.05)[..., None]
    of_vv = 2 * unsteady * d
    of_pv, of_pp = 0.5 * of_vv * d, of_vv * d**2 / 3
    for i, (d_s, square_s2) in enumerate(zip(d, d**2, strict=True)):
        pp = pp + 2 * d_s * pv + square_s2 * vv + of_pp[i]
        pv = pv + d_s * vv + of_pv[i]
        whole = pp + noise
        p, v = pp / whole, pv / whole
        out[i] = p, v, whole
        pp, pv, vv = noise * p, noise * v, vv + of_vv[i] - v * pv
    return out


def _history(parents: np.ndarray, states: np.ndarray) -> np.ndarray:
    """States of the best history, (n, runs, g)."""
    n, runs, g, histories = parents.shape
    out = np.empty((n + 1, runs, g), bool)
    begin = histories * np.arange(runs * g).reshape(runs, g)
    at = np.zeros((runs, g), np.int64)
    for i in range(n - 1, -1, -1):
        out[i + 1] = states[i].take(begin + at)
        at = parents[i].take(begin + at)
    out[0] = out[1]
    return out
