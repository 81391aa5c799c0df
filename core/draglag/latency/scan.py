"""J(L) over a window of latencies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from draglag.instruments.beam import sides
from draglag.latency.edges import Edges
from draglag.latency.path import Path
from draglag.path.events import contact_losses, in_contact, sample_interval_s
from draglag.path.savgol import smoothed
from draglag.recording import FloatArray, TouchTrace

MANY_EDGES = 50


@dataclass(frozen=True)
class Scan:
    """Robust cost per edge; infinite with too few edges."""

    latency_s: FloatArray
    cost_mm2: FloatArray

    def between(self, k: int) -> float:
        """Cost at the lowest point of the parabola through a minimum and its neighbours."""
        if not 0 < k < self.cost_mm2.size - 1:
            return float(self.cost_mm2[k])
        before, here, after = self.cost_mm2[k - 1 : k + 2]
        bend = before + after - 2 * here
        low = here - (after - before) ** 2 / (8 * bend) if 0 < bend < np.inf else here
        return max(float(low), 0.0)

    def minima(self, most: int = 4) -> list[int]:
        """Indices of the local minima, best first."""
        cost = self.cost_mm2
        padded = np.concatenate([[np.inf], cost, [np.inf]])
        low = np.flatnonzero((cost <= padded[:-2]) & (cost < padded[2:]) & np.isfinite(cost))
        return [int(k) for k in low[np.argsort(cost[low])][:most]]


def scan(
    touch: TouchTrace,
    edges: Edges,
    window_s: tuple[float, float],
    stylus_diameter_mm: float | None = None,
    path: Path | None = None,
    losses_s: FloatArray | None = None,
    half_width_s: float = 0.0,
    step_s: float = 0.004,
) -> Scan:
    """Cost of Eq. 2 over a grid, one slope for both lines.

    A known diameter excludes aliases, a quarter of a circle's period off, where lines lie far apart.
    """
    latency_s = np.arange(window_s[0], window_s[1] + step_s / 2, step_s)
    # An odd stride keeps both kinds of edges; some sixty edges are enough to separate minima.
    some = slice(None, None, 2 * (edges.t_s.size // (2 * MANY_EDGES)) + 1)
    at_s = edges.t_s[None, some] + latency_s[:, None]
    placed = in_contact(touch.t_s, at_s, contact_losses(touch.t_s) if losses_s is None else losses_s)
    if path is not None:
        inside_s = np.clip(at_s, touch.t_s[0], touch.t_s[-1])
        xy_mm, v_mm_s = path.with_velocity(inside_s)
        x, y, v = xy_mm[..., 0], xy_mm[..., 1], v_mm_s[..., 1]
    else:
        x, y, v = _moved(touch, at_s, half_width_s)
    side = sides(edges.falling[None, some], v)
    cost, apart_mm = _cost(x, y, side, placed)
    if stylus_diameter_mm is not None:
        least, most = 0.1 * stylus_diameter_mm, 2.5 * stylus_diameter_mm + 2.0
        cost = np.where((apart_mm > least) & (apart_mm < most), cost, np.inf)
    enough = np.count_nonzero(placed, axis=1) >= max(4, 0.6 * np.max(np.count_nonzero(placed, axis=1), initial=0))
    return Scan(latency_s, np.where(enough, cost, np.inf))


def _moved(touch: TouchTrace, at_s: FloatArray, half_width_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    dt_s = sample_interval_s(touch.t_s)
    grid_s = np.arange(touch.t_s[0], touch.t_s[-1] + dt_s / 2, dt_s)
    reach = max(2, round(0.7 * half_width_s / dt_s))
    x_mm, y_mm = (np.interp(grid_s, touch.t_s, v) for v in (touch.x_mm, touch.y_mm))
    if grid_s.size > 2 * reach + 1:
        vy = smoothed(y_mm, 2 * reach + 1, 3, 1, dt_s)
        y_mm = smoothed(y_mm, 2 * reach + 1, 3)
    else:
        vy = np.gradient(y_mm, dt_s)
    position = np.clip((at_s - grid_s[0]) / dt_s, 0, grid_s.size - 1.001)
    k = position.astype(int)
    f = position - k
    x, y, v = ((1 - f) * a[k] + f * a[k + 1] for a in (x_mm, y_mm, vy))
    return x, y, v


def _cost(x: FloatArray, y: FloatArray, side: FloatArray, placed: np.ndarray) -> tuple[FloatArray, FloatArray]:
    weight = placed.astype(float)
    n = np.minimum(np.count_nonzero(placed, axis=1), placed.shape[1] - 1)
    above, below = side < 0, side > 0
    for _ in range(3):
        (x_top, y_top), (x_bottom, y_bottom) = (_means(weight * part, x, y) for part in (above, below))
        xc = x - np.where(above, x_top[:, None], x_bottom[:, None])
        yc = y - np.where(above, y_top[:, None], y_bottom[:, None])
        weighted = weight * xc
        sxx = np.maximum(np.einsum("ln,ln->l", weighted, xc), 1e-12)
        # ±11°: a beam, not a fit to the circle
        slope = np.clip(np.einsum("ln,ln->l", weighted, yc) / sxx, -0.2, 0.2)
        squared = (yc - slope[:, None] * xc) ** 2
        ranks = np.unique(n // 2)
        scale = np.partition(np.where(placed, squared, np.inf), ranks, axis=1)[np.arange(n.size), n // 2]
        limit = 20 * np.maximum(scale, 1e-9)[:, None]  # about 3 σ of a normal residual
        weight = placed * np.minimum(1.0, np.sqrt(limit / np.maximum(squared, 1e-12)))
    one_sided = (np.count_nonzero(placed & (side < 0), 1) < 2) | (np.count_nonzero(placed & (side > 0), 1) < 2)
    robust = (placed * np.minimum(squared, limit)).sum(1) / np.maximum(placed.sum(1), 1)
    return np.where(one_sided, np.inf, robust), y_bottom - y_top - slope * (x_bottom - x_top)


def _means(weight: FloatArray, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    total = np.maximum(weight.sum(1), 1e-12)
    return np.einsum("ln,ln->l", weight, x) / total, np.einsum("ln,ln->l", weight, y) / total
