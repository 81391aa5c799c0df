"""Panel and laser: reports of the digitiser (delayed by a law of the speed), edges of a Gaussian beam's comparator."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.special import ndtr

from .hand import STEP_HZ, Motion

Law = Callable[[np.ndarray], np.ndarray]
LEAST_DELAY_S = 0.001
CATCH_UP = 0.03  # of real time: where the latency falls faster than time passes, the trace shows the past this slowly


@dataclass(frozen=True)
class Sensor:
    """Light sensor: Gaussian beam, comparator at a fraction of the full light with hysteresis, response time."""

    sigma_mm: float
    threshold: float
    hysteresis: float
    response_s: float = 55e-6


@dataclass(frozen=True)
class Panel:
    """Digitiser: law (mm/s -> s), rate, noise (standard deviation a coordinate), steps its numbers come in, jitter."""

    law: Law
    rate_hz: float
    noise_mm: float
    step_mm: float
    jitter_s: float


def draw_law(rng: np.random.Generator, form: str) -> Law:
    """A law of one of five forms."""
    if form == "constant":
        level = rng.uniform(0.03, 0.09)
        return lambda v: np.full_like(v, level)
    if form == "power":
        floor, scale, power = rng.uniform(0.02, 0.03), rng.uniform(0.08, 0.14), rng.uniform(0.5, 1.0)
        return lambda v: floor + scale * (np.maximum(v, 15.0) / 45.0) ** -power
    if form == "adaptive":
        floor, f0, beta = rng.uniform(0.02, 0.03), rng.uniform(0.6, 1.5), rng.uniform(0.01, 0.03)
        return lambda v: floor + 1 / (2 * np.pi * (f0 + beta * v))
    if form == "logistic":
        fast, slow, middle = rng.uniform(0.025, 0.035), rng.uniform(0.07, 0.11), rng.uniform(120, 260)
        return lambda v: fast + (slow - fast) / (1 + (v / middle) ** 3)
    a1, a2, a4 = rng.uniform(0.01, 0.09), rng.uniform(0.003, 0.005), rng.uniform(0.12, 0.2)
    a5, a7 = rng.uniform(0.018, 0.029), rng.uniform(0.023, 0.032)
    return lambda v: a1 * np.exp(-a2 * v) + a4 * np.exp(-a5 * v) + a7


FORMS = ("constant", "power", "adaptive", "logistic", "double")


def reports(
    rng: np.random.Generator, panel: Panel, motion: Motion, span_s: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Stamps (m,), x and y (m,) of the reports, and the delay (n,) s of the noise-free trace of every step."""
    # A tracker follows the velocity over some 50 ms.
    v = gaussian_filter1d(motion.speed_mm_s, 0.05 * STEP_HZ, truncate=3.0)
    behind = np.maximum(panel.law(v), LEAST_DELAY_S)
    steady = CATCH_UP * motion.t_s
    shown_at = np.maximum.accumulate(motion.t_s + behind - steady) + steady
    tau = np.arange(span_s[0] + rng.uniform(0.3, 0.4), span_s[1], 1 / panel.rate_hz)
    tau = tau + panel.jitter_s * rng.normal(size=tau.size).clip(-3, 3)
    x, y = (
        np.interp(tau, shown_at, q) + panel.noise_mm * rng.normal(size=tau.size) for q in (motion.x_mm, motion.y_mm)
    )
    x, y = (np.round(q / panel.step_mm) * panel.step_mm for q in (x, y))
    return tau, x, y, shown_at - motion.t_s


MISSED = 0.02  # of the passes: the stylus is lifted over the beam


def edges(
    rng: np.random.Generator,
    sensor: Sensor,
    motion: Motion,
    diameter_mm: float,
    beam: tuple[float, float, float],
    span_s: tuple[float, float],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stamps (k,), light after the edge (k,), and true time (k,) at which the disc's rim was half across the beam.

    beam: slope, intercept mm, bow mm over 100 mm either side of x = 150 mm.
    """
    slope, intercept_mm, bow_mm = beam
    off = motion.y_mm - intercept_mm - slope * motion.x_mm - bow_mm * ((motion.x_mm - 150) / 100) ** 2
    off = off / np.hypot(1, slope)
    half = 0.5 * diameter_mm
    light = ndtr((off - half) / sensor.sigma_mm) + ndtr((-off - half) / sensor.sigma_mm)
    low, high = sensor.threshold - sensor.hysteresis, sensor.threshold + sensor.hysteresis
    stamps, levels, ideal = [], [], []
    lit, missed = True, False
    goes = np.flatnonzero((light[1:] < low) & (light[:-1] >= low))
    comes = np.flatnonzero((light[1:] > high) & (light[:-1] <= high))
    step = 1 / STEP_HZ
    for k, falls in sorted([(int(k), True) for k in goes] + [(int(k), False) for k in comes]):
        if falls != lit:
            continue
        level = low if falls else high
        share = (light[k] - level) / (light[k] - light[k + 1])
        # Without hysteresis: where the light passes the threshold itself; the same path, so a local straight line.
        at = (light[k] - sensor.threshold) / (light[k] - light[k + 1])
        when = motion.t_s[k] + step * share
        missed = rng.random() < MISSED if falls else missed
        if span_s[0] <= when < span_s[1] and not missed:
            stamps.append(when + sensor.response_s)
            levels.append(0 if falls else 1)
            ideal.append(motion.t_s[k] + step * at)
        lit = not falls
    return np.array(stamps), np.array(levels), np.array(ideal)
