"""Prediction: a report is moved ahead along the velocity of the last moments."""

import numpy as np

WINDOW_S = 0.02


def predict(t_s: np.ndarray, xy: tuple[np.ndarray, np.ndarray], horizon_s: float) -> tuple[np.ndarray, np.ndarray]:
    """x and y (n,) extrapolated by `horizon_s` with the mean velocity of the last 20 ms, or of two scans if longer.

    A touch that has just begun, or a tap, has no velocity and stays in place.
    """
    # The oldest scan in the window; where scans are further apart than the window, the one before.
    since = np.minimum(np.searchsorted(t_s, t_s - WINDOW_S - 1e-9), np.maximum(np.arange(len(t_s)) - 1, 0))
    took = t_s - t_s[since]
    share = np.where(took > 0, horizon_s / np.maximum(took, 1e-9), 0.0)
    x, y = (q + share * (q - q[since]) for q in xy)
    return x, y
