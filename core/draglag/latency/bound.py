"""Cramér–Rao bound of a latency, under the simulation's model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from draglag.recording import FloatArray

REACH_S = 0.6  # events further from a crossing say nothing more about it
BLOCK_GAP_S = 0.35  # edges closer together than this share touch noise


@dataclass(frozen=True)
class TouchNoise:
    """Noise of one coordinate; ``slow_share`` of its variance is correlated over slow_s."""

    sd_mm: float
    slow_share: float = 0.0
    slow_s: float = 0.04
    resolution_mm: float = 0.0

    def covariance(self, t_s: FloatArray) -> FloatArray:
        lag_s = np.abs(t_s[:, None] - t_s[None, :])
        slow = self.slow_share * np.exp(-lag_s / self.slow_s)
        white = (1 - self.slow_share) * self.sd_mm**2 + self.resolution_mm**2 / 12
        return np.asarray(self.sd_mm**2 * slow + max(white, 1e-12) * np.eye(t_s.size))


@dataclass(frozen=True)
class HandSpectrum:
    """The hand's deviations, as in ``draglag.simulation.Human``."""

    wander_mm: float = 1.5
    wander_hz: float = 0.5
    timing_sd_s: float = 0.02
    timing_hz: float = 0.4
    gain_sd: float = 0.02
    tremor_mm: float = 0.05
    tremor_hz: tuple[float, float] = (8.0, 12.0)


class _Kernel:
    """Covariance of the hand's deviations; Butterworth filters run both ways have the power 1 / (1 + (f/f₀)⁴)²."""

    STEP_HZ = 0.08  # repeats after 12 s, far longer than a block

    def __init__(self, hand: HandSpectrum) -> None:
        self.hand = hand
        low, high = hand.tremor_hz
        slow_hz = np.arange(self.STEP_HZ / 2, 3 * max(hand.wander_hz, hand.timing_hz), self.STEP_HZ)
        fast_hz = np.arange(0.5 * low, 1.6 * high, self.STEP_HZ)
        centre, width = np.sqrt(low * high), high - low
        detuned = (fast_hz**2 - centre**2) / (fast_hz * width)
        self._parts = [
            (hand.wander_mm, slow_hz, _low_pass(slow_hz, hand.wander_hz)),
            (hand.timing_sd_s, slow_hz, _low_pass(slow_hz, hand.timing_hz)),
            (hand.tremor_mm, fast_hz, 1 / (1 + detuned**4) ** 2),
        ]

    def features(self, t_s: FloatArray, across_mm_s: FloatArray, y_mm: FloatArray) -> FloatArray:
        """F (n, k), with F Fᵀ the covariance of the path across the beam."""
        columns = [10.0 * np.ones((t_s.size, 1)), self.hand.gain_sd * y_mm[:, None]]
        for part, (sd, f_hz, power) in enumerate(self._parts):
            if sd <= 0:
                continue
            phase = 2 * np.pi * np.outer(t_s, f_hz)
            size = sd * np.sqrt(power / power.sum())
            scale = across_mm_s[:, None] if part == 1 else 1.0  # uneven timing moves the stylus along its path
            columns += [scale * np.cos(phase) * size, scale * np.sin(phase) * size]
        return np.hstack(columns)


def _blocks(edge_t_s: FloatArray) -> list[np.ndarray]:
    starts, begin = [], 0
    for k in range(1, edge_t_s.size):
        gap_s = edge_t_s[k] - edge_t_s[k - 1]
        long = edge_t_s[k] - edge_t_s[begin] > 0.8 and gap_s > 0.5 * (edge_t_s[k - 1] - edge_t_s[k - 2])
        if gap_s > BLOCK_GAP_S or long:
            starts.append(k)
            begin = k
    return np.split(np.arange(edge_t_s.size), starts)


def _low_pass(f_hz: FloatArray, corner_hz: float) -> FloatArray:
    return np.asarray(1 / (1 + (f_hz / corner_hz) ** 4) ** 2)


def _posterior(edge_f: FloatArray, event_f: FloatArray, noise: FloatArray) -> FloatArray:
    """Covariance of the path at m edges once n events are known, from the features (m, k) and (n, k) of both."""
    n, k = event_f.shape
    if n < k:  # the same by Woodbury's identity, with matrices (n, n) in place of (k, k)
        shared = event_f @ edge_f.T
        known = shared.T @ cho_solve(cho_factor(event_f @ event_f.T + noise), shared)
        return np.asarray(edge_f @ edge_f.T - known)
    precision = np.eye(k) + event_f.T @ cho_solve(cho_factor(noise), event_f)
    return np.asarray(edge_f @ cho_solve(cho_factor(precision), edge_f.T))


def latency_bound_s(
    edge_t_s: FloatArray,
    edge_x_mm: FloatArray,
    edge_v_mm_s: FloatArray,
    side: FloatArray,
    event_t_s: FloatArray,
    event_v_mm_s: FloatArray,
    event_y_mm: FloatArray,
    noise: TouchNoise,
    hand: HandSpectrum | None = None,
    edge_y_mm: float = 0.0,
) -> float:
    """Smallest standard error of any unbiased estimate of a run's latency; infinite where undetermined.

    Args:
        edge_t_s, edge_x_mm, edge_v_mm_s, side: (m,) edges: time, place along the beam, velocity across it, ±1.
        event_t_s, event_v_mm_s, event_y_mm: (n,) events: stamp less latency, velocity across the beam, distance from
            the figure's middle.
        edge_y_mm: the beam's distance from that middle.
    """
    kernel = _Kernel(hand or HandSpectrum())
    blocks = _blocks(edge_t_s)
    design = np.column_stack([-edge_v_mm_s, edge_x_mm - edge_x_mm.mean(), np.ones(edge_t_s.size), side])
    size = design.shape[1]
    information = np.zeros((size, size))
    for block in blocks:
        t_s, v = edge_t_s[block], edge_v_mm_s[block]
        near = (event_t_s > t_s[0] - REACH_S) & (event_t_s < t_s[-1] + REACH_S)
        if np.count_nonzero(near) < 4:
            continue
        u_s, w, y = event_t_s[near], event_v_mm_s[near], event_y_mm[near]
        middle_s = float(t_s.mean())
        edge_f = kernel.features(t_s - middle_s, v, np.full_like(t_s, edge_y_mm))
        event_f = kernel.features(u_s - middle_s, w, y)
        posterior = _posterior(edge_f, event_f, noise.covariance(u_s))
        posterior += 1e-9 * max(float(np.trace(posterior)), 1e-9) * np.eye(t_s.size)
        information += design[block].T @ np.linalg.solve(posterior, design[block])
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    normalised = information / np.outer(scale, scale)
    if not np.isfinite(normalised).all() or np.linalg.cond(normalised) > 1e13:
        return float("inf")
    return float(np.sqrt(np.linalg.inv(normalised)[0, 0]) / scale[0])
