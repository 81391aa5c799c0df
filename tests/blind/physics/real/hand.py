"""Path of a stylus that a hand drags round an imperfect ellipse, or after a target: arrays at 4 kHz."""

import numpy as np
from scipy.signal import butter, sosfilt

from ..motion import Motion

STEP_HZ = 4000.0
LEAD_S, TAIL_S = 1.0, 0.5  # before and after the recording: delayed reports have a past, latency shifts a future
SLOW_MM_S = 220.0  # below this a hand stops now and then


def clock(duration_s: float) -> np.ndarray:
    """Time since the recording began, with the lead before and the tail after it."""
    return np.arange(round((LEAD_S + duration_s + TAIL_S) * STEP_HZ)) / STEP_HZ - LEAD_S


def drag(
    rng: np.random.Generator,
    speed_mm_s: float | np.ndarray,
    radius_mm: float,
    duration_s: float,
    centre_mm: tuple[float, float],
    travel_mm: float,
) -> Motion:
    """One run of circles whose centre travels along x; the intended speed is one number or one per step of `clock`.

    Ellipse (axes 0.82 to 1), speed by the two-thirds power law, corrections of 2 to 6 % at 0.5 to 2 Hz, drift of mm
    below 0.4 Hz, tremor of 8 to 12 Hz with a peak of 0.05 to 0.3 mm, pauses in slow runs.
    """
    t_s = clock(duration_s)
    n = len(t_s)
    minor, tilt = rng.uniform(0.82, 1.0), rng.uniform(0, np.pi)
    rate = 1 + rng.uniform(0.02, 0.06) * _noise(rng, n, 0.5, 2.0)
    pauses = rng.poisson(0.04 * duration_s) if np.mean(speed_mm_s) < SLOW_MM_S else 0
    for at_s in rng.uniform(1.0, duration_s - 1.0, pauses):
        rate *= 1 - _bump(t_s, at_s, rng.uniform(0.1, 0.4))
    # Two-thirds power law: the tangential speed goes with curvature to the power of -1/3, so that the angle of the
    # ellipse's parameter advances evenly (an ellipse drawn by two sines obeys the law exactly).
    mean_speed = radius_mm * np.mean(np.hypot(np.sin(_TURN), minor * np.cos(_TURN)))
    start = rng.uniform(0, 2 * np.pi)
    if np.ndim(speed_mm_s) == 0:
        turned = np.cumsum(rate) / STEP_HZ * speed_mm_s / mean_speed
    else:
        turned = np.cumsum(rate * speed_mm_s) / STEP_HZ / mean_speed
    phase = start + turned * rng.choice([-1, 1])
    a, b = radius_mm * np.cos(phase), radius_mm * minor * np.sin(phase)
    x = a * np.cos(tilt) - b * np.sin(tilt) + centre_mm[0] + travel_mm * (t_s / duration_s - 0.5)
    y = a * np.sin(tilt) + b * np.cos(tilt) + centre_mm[1]
    return follow(rng, t_s, x, y)


def follow(rng: np.random.Generator, t_s: np.ndarray, x: np.ndarray, y: np.ndarray) -> Motion:
    """The intended path (n,) mm as a hand makes it: with a drift of mm below 0.4 Hz, and with tremor."""
    n = len(t_s)
    drift_mm = rng.uniform(0.5, 2.0)
    x, y = x + drift_mm * _noise(rng, n, 0.02, 0.4), y + drift_mm * _noise(rng, n, 0.02, 0.4)
    vx, vy = np.gradient(x) * STEP_HZ, np.gradient(y) * STEP_HZ
    speed = np.hypot(np.gradient(x), np.gradient(y)) * STEP_HZ
    tremor_mm = rng.uniform(0.05, 0.3) / 3.0  # a peak is three standard deviations of narrow-band noise
    x, y = x + tremor_mm * _noise(rng, n, 8, 12), y + tremor_mm * _noise(rng, n, 8, 12)
    return Motion(t_s, x, y, vx, vy, speed, np.gradient(speed) * STEP_HZ, STEP_HZ)


_TURN = np.linspace(0, 2 * np.pi, 400, endpoint=False)


def _bump(t_s: np.ndarray, at_s: float, lasts_s: float) -> np.ndarray:
    """1 for ``lasts_s`` about ``at_s`` with ramps of 0.1 s: how a hand stops and goes on."""
    return np.clip((0.5 * lasts_s + 0.1 - np.abs(t_s - at_s)) / 0.1, 0, 1)


def _noise(rng: np.random.Generator, n: int, low_hz: float, high_hz: float) -> np.ndarray:
    """Gaussian noise of unit variance in a band."""
    lead = int(STEP_HZ * min(20.0, 3.0 / low_hz))
    raw = rng.normal(size=n + lead)
    out = sosfilt(butter(2, [low_hz, high_hz], "bandpass", fs=STEP_HZ, output="sos"), raw)[lead:]
    return out / out.std()
