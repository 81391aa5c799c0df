"""Low-passes: a first-order one, and a moving average whose window gets shorter with speed."""

import numpy as np

# Windows as shares of the longest, and the speeds (mm/s) above which the next one holds.
WINDOWS = (1.0, 0.5, 0.1875)
ABOVE_MM_S = (90.0, 260.0)
SPEED_WINDOW_S = 0.05


def first_order(t_s: np.ndarray, xy: tuple[np.ndarray, np.ndarray], tau_s: float) -> tuple[np.ndarray, np.ndarray]:
    """x and y (n,) behind a low-pass of time constant `tau_s`, which is also its lag behind a steady movement."""
    shares = [dt / (dt + tau_s) for dt in np.maximum(np.diff(t_s), 1e-6).tolist()]
    outs = []
    for q in xy:
        at = float(q[0])
        out = [at]
        for share, p in zip(shares, q[1:].tolist(), strict=True):
            at += share * (p - at)
            out.append(at)
        outs.append(np.array(out))
    return outs[0], outs[1]


def moving_average(
    t_s: np.ndarray, xy: tuple[np.ndarray, np.ndarray], longest_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """x and y (n,), each the mean of the last window: `longest_s` when slow, half of it, then three sixteenths, by the
    speed of the mean over 50 ms."""
    n = np.arange(len(t_s))
    before = np.minimum(np.searchsorted(t_s, t_s - SPEED_WINDOW_S), np.maximum(n - 1, 0))
    took = np.maximum(t_s - t_s[before], 1e-6)
    speed = np.hypot(*(q - q[before] for q in xy)) / took
    window_s = longest_s * np.array(WINDOWS)[np.searchsorted(ABOVE_MM_S, speed)]
    first = np.searchsorted(t_s, t_s - window_s, side="right")
    x, y = (_mean_from(q, np.minimum(first, n)) for q in xy)
    return x, y


def _mean_from(q: np.ndarray, first: np.ndarray) -> np.ndarray:
    total = np.concatenate([[0.0], np.cumsum(q - q[0])])
    end = np.arange(len(q)) + 1
    return q[0] + (total[end] - total[first]) / (end - first)
