"""Alpha-beta tracker: position and velocity are carried on, and corrected by what each scan shows."""

import math

import numpy as np


def alpha_beta(
    t_s: np.ndarray, xy: tuple[np.ndarray, np.ndarray], tau_s: float, ahead_s: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """x and y (n,) of a tracker of time constant `tau_s`, shown `ahead_s` ahead.

    beta = alpha² / (2 - alpha). No lag at constant velocity; -a dt² (1 - alpha) / beta at acceleration `a`.
    """
    steps = np.maximum(np.diff(t_s), 1e-6).tolist()
    outs = []
    for q in xy:
        at, speed = float(q[0]), 0.0
        out = [at]
        for dt, p in zip(steps, q[1:].tolist(), strict=True):
            alpha = 1 - math.exp(-dt / tau_s)
            expected = at + speed * dt
            at = expected + alpha * (p - expected)
            speed += alpha**2 / (2 - alpha) * (p - expected) / dt
            out.append(at + speed * ahead_s)
        outs.append(np.array(out))
    return outs[0], outs[1]
