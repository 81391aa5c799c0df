"""A target moves, a hand follows it, the stylus's tip is where the hand is."""

import numpy as np
from scipy.signal import bilinear, lfilter

from .motion import Motion, tracked
from .rig import Rig, RunPlan

STEP_HZ = 2000.0
LEAD_S = 1.0  # motion before the recording starts, so that filters have settled and a late report has a past to show
TAIL_S = 0.3

# Table 1 of the paper: rad/s, amplitude, phase
MULTISINE = np.array(
    [
        (0.614, 1.079, 7.239), (1.074, 0.776, 0.506), (1.994, 0.391, 7.86), (2.915, 0.225, 8.184),
        (4.449, 0.117, 9.012), (5.676, 0.082, 6.141), (6.596, 0.066, 6.776), (9.050, 0.051, 6.265),
        (12.118, 0.035, 4.432), (16.720, 0.028, 2.672), (24.083, 0.024, 8.009),
    ]
)  # fmt: skip


def move(rig: Rig, run: RunPlan, rng: np.random.Generator) -> Motion:
    """Step the stylus through one run."""
    dt = 1 / STEP_HZ
    n = round((LEAD_S + run.duration_s + TAIL_S) * STEP_HZ)
    since = np.arange(n) * dt - LEAD_S
    hand = rig.hand
    x, y = _target(rig, run, since, rng)
    omega = 2 * np.pi * hand["natural_hz"]
    b, a = bilinear([omega**2], [1, 1.6 * omega, omega**2], STEP_HZ)
    tip, drag = [], []
    for axis in (x, y):
        intended = axis[0] + lfilter(b, a, axis - axis[0])
        intended += hand["wander_mm"] * _coloured(rng, n, hand["wander_hz"])
        tip.append(intended + hand["tremor_mm"] * _tremor(rng, n, hand["tremor_hz"]))
        drag.append(np.gradient(intended, dt))
    # What a digitiser's tracker takes for the speed of the drag: of the movement without the tremor, over its window.
    # (Smoothing the speed, not the velocity: on a small fast circle that would read low.)
    speed = tracked(np.hypot(*drag), rig.speed_window_s, STEP_HZ)
    return Motion(since + run.start_s, *tip, *drag, speed, np.gradient(speed, dt), STEP_HZ)


def _target(rig: Rig, run: RunPlan, since: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    width, height = rig.screen[1], rig.screen[2]
    hand = rig.hand
    r = run.radius_mm
    margin = r + 12.0 if run.protocol in ("circle", "chirp") else 0.16 * width
    progress = np.clip(since / run.duration_s, 0, 1)
    centre_x = margin + (width - 2 * margin) * progress
    middle = rig.beam_slope * width / 2 + rig.beam_intercept_mm + run.centre_off_beam_mm
    if run.protocol in ("circle", "chirp"):
        if run.protocol == "circle":
            assert run.nominal_speed_mm_s is not None
            wanted = np.full_like(since, run.nominal_speed_mm_s / (2 * np.pi * r))
        else:
            wanted = 0.05 + 0.95 * progress
        # People keep the size of the circle and fall behind in rate when it gets fast.
        turns_hz = wanted / (1 + (wanted / hand["fastest_hz"]) ** 3) ** (1 / 3)
        turns_hz = turns_hz * (1 + hand["uneven"] * _coloured(rng, len(since), 0.5))
        phase0 = rng.uniform(0, 2 * np.pi)
        phase = phase0 + 2 * np.pi * np.cumsum(turns_hz) / STEP_HZ
        # Some directions of movement come easier: gain there, lose a quarter turn on.
        phase = phase + 0.5 * hand["preference"] * np.sin(2 * (phase - hand["preferred_rad"]))
        sense = 1.0 if run.clockwise else -1.0
        return centre_x + r * np.cos(phase), middle + sense * r * np.sin(phase)
    if run.protocol == "multisine":
        return centre_x, middle + multisine_mm(since, height)
    return centre_x, middle + steps_mm(since, height, rng)


def multisine_mm(since: np.ndarray, height_mm: float) -> np.ndarray:
    """The paper's sum of sines about its middle, (n,), on a screen of this height."""
    signal = (MULTISINE[:, 1:2] * np.sin(MULTISINE[:, :1] * since + MULTISINE[:, 2:])).sum(axis=0)
    return np.asarray(0.2 * height_mm / 1.6 * signal)


def steps_mm(since: np.ndarray, height_mm: float, rng: np.random.Generator) -> np.ndarray:
    """Steps up and back about their middle, (n,), that stay on a screen of this height."""
    return _steps(since, min(0.4 * height_mm, 0.95 * (height_mm / 2 - 10)), rng)


def _steps(since: np.ndarray, size: float, rng: np.random.Generator) -> np.ndarray:
    """Bell-shaped steps of `size` up and back, whose crossing of the beam falls at 5 to 95 % of the bell."""
    level = -size * rng.choice([0.05, 0.25, 0.5, 0.75, 0.95])
    y, when = np.full_like(since, level), 0.4
    while when < since[-1]:
        start = -size * rng.choice([0.05, 0.25, 0.5, 0.75, 0.95])
        for goal, took in ((start, 0.3), (start + size, rng.uniform(0.5, 0.8)), (start, rng.uniform(0.5, 0.8))):
            u = np.clip((since - when) / took, 0, 1)
            y += (goal - level) * u**3 * (10 - 15 * u + 6 * u**2)
            level = goal
            when += took + rng.uniform(0.3, 0.7)
    return y


def _coloured(rng: np.random.Generator, n: int, corner_hz: float) -> np.ndarray:
    """Noise of unit variance, low-passed twice at `corner_hz`."""
    pole = np.exp(-2 * np.pi * corner_hz / STEP_HZ)
    out = lfilter([1], [1, -2 * pole, pole**2], rng.normal(size=n + int(2 * STEP_HZ)))[int(2 * STEP_HZ) :]
    # variance of a double pole driven by white noise
    return out * np.sqrt((1 - pole**2) ** 3 / (1 + pole**2))


def _tremor(rng: np.random.Generator, n: int, centre_hz: float) -> np.ndarray:
    """Noise of unit variance in a band about 2 Hz wide around `centre_hz`."""
    pole = np.exp(-np.pi * 2.0 / STEP_HZ)
    angle = 2 * np.pi * centre_hz / STEP_HZ
    raw = lfilter([1, -1], [1, -2 * pole * np.cos(angle), pole**2], rng.normal(size=n + int(2 * STEP_HZ)))
    raw = raw[int(2 * STEP_HZ) :]
    return raw / raw.std()
