"""Panel and laser: reports of the digitiser (delayed by a law of the speed), edges of a Gaussian beam's comparator."""

from dataclasses import dataclass

import numpy as np
from tests.blind.physics.law import Law
from tests.blind.physics.motion import Motion, tracked
from tests.blind.physics.real.beam import Sensor, crossings

LEAST_DELAY_S = 0.001
TRACKED_S = 0.05  # over which a tracker follows the velocity
CATCH_UP = 0.03  # of real time: where the latency falls faster than time passes, the trace shows the past this slowly


@dataclass(frozen=True)
class Panel:
    """Digitiser: law (mm/s -> s), rate, noise (standard deviation per coordinate), resolution, jitter of scans, and
    polling by the bus (0: reports come at once)."""

    law: Law
    rate_hz: float
    noise_mm: float
    step_mm: float
    jitter_s: float
    poll_s: float = 0.0


def reports(
    rng: np.random.Generator, panel: Panel, motion: Motion, span_s: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Stamps (m,), x and y (m,) of the reports, and the delay (n,) s with which they show the place of every step."""
    v = tracked(motion.speed_mm_s, TRACKED_S, motion.step_hz)
    behind = np.maximum(panel.law(v), LEAST_DELAY_S)
    steady = CATCH_UP * motion.t_s
    shown_at = np.maximum.accumulate(motion.t_s + behind - steady) + steady
    tau = np.arange(span_s[0] + rng.uniform(0.3, 0.4), span_s[1], 1 / panel.rate_hz)
    tau = tau + panel.jitter_s * rng.normal(size=tau.size).clip(-3, 3)
    x, y = (
        np.interp(tau, shown_at, q) + panel.noise_mm * rng.normal(size=tau.size) for q in (motion.x_mm, motion.y_mm)
    )
    x, y = (np.round(q / panel.step_mm) * panel.step_mm for q in (x, y))
    stamp = tau
    if panel.poll_s:
        phase_s = rng.uniform(0, panel.poll_s)
        stamp = phase_s + np.ceil((tau - phase_s) / panel.poll_s) * panel.poll_s + rng.exponential(ARRIVAL_S, tau.size)
        stamp = np.round(np.maximum.accumulate(stamp), 6)
    return stamp, x, y, shown_at + np.interp(shown_at, tau, stamp - tau) - motion.t_s


ARRIVAL_S = 4e-5  # scheduling of the host


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
    return crossings(rng, sensor, motion.t_s, off / np.hypot(1, slope), 0.5 * diameter_mm, span_s)
