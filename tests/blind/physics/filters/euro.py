"""1 euro filter: a first-order low-pass whose cut-off is fmin + beta · |speed|, the speed low-passed itself."""

import math

import numpy as np

DERIVATIVE_HZ = 1.0


def euro(
    t_s: np.ndarray, xy: tuple[np.ndarray, np.ndarray], fmin_hz: float, beta: float, per_axis: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """x and y (n,) of the filter; beta in Hz per mm/s. `per_axis`: cut-offs by each axis' own speed, as where the
    filter runs on numbers, not points."""
    x, y = float(xy[0][0]), float(xy[1][0])
    last_x, last_y, dx, dy = x, y, 0.0, 0.0
    out_x, out_y = [x], [y]
    for dt, px, py in zip(np.diff(t_s).tolist(), xy[0][1:].tolist(), xy[1][1:].tolist(), strict=True):
        dt = max(dt, 1e-6)
        a = _share(dt, DERIVATIVE_HZ)
        dx += a * ((px - last_x) / dt - dx)
        dy += a * ((py - last_y) / dt - dy)
        last_x, last_y = px, py
        speeds = (abs(dx), abs(dy)) if per_axis else (math.hypot(dx, dy),) * 2
        x += _share(dt, fmin_hz + beta * speeds[0]) * (px - x)
        y += _share(dt, fmin_hz + beta * speeds[1]) * (py - y)
        out_x.append(x)
        out_y.append(y)
    return np.array(out_x), np.array(out_y)


def _share(dt_s: float, cutoff_hz: float) -> float:
    """Share of the new value in a step: lags a steady movement by 1 / (2 pi cut-off)."""
    return dt_s / (dt_s + 1 / (2 * math.pi * cutoff_hz))
