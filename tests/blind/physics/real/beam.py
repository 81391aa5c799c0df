"""A Gaussian beam on a light sensor whose comparator has hysteresis."""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

MISSED = 0.02  # of the passes: the stylus is lifted over the beam


@dataclass(frozen=True)
class Sensor:
    """Light sensor: Gaussian beam, comparator at a fraction of the full light with hysteresis, response time."""

    sigma_mm: float
    threshold: float
    hysteresis: float
    response_s: float = 55e-6

    @property
    def widens_mm(self) -> float:
        """By how much a disc's apparent diameter exceeds its own: a threshold below half the light makes it smaller."""
        return 2 * self.sigma_mm * float(ndtri(self.threshold))


def crossings(
    rng: np.random.Generator,
    sensor: Sensor,
    t_s: np.ndarray,
    off_mm: np.ndarray,
    half_mm: float | np.ndarray,
    span_s: tuple[float, float],
    missed_share: float = MISSED,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stamps (k,), light after the edge (k,), and true time (k,) at which the light passed the threshold.

    off_mm (n,): signed distance of the disc's centre from the beam's axis; half_mm: the disc's radius, one or (n,).
    """
    light = ndtr((off_mm - half_mm) / sensor.sigma_mm) + ndtr((-off_mm - half_mm) / sensor.sigma_mm)
    low, high = sensor.threshold - sensor.hysteresis, sensor.threshold + sensor.hysteresis
    stamps, levels, ideal = [], [], []
    lit, missed = True, False
    goes = np.flatnonzero((light[1:] < low) & (light[:-1] >= low))
    comes = np.flatnonzero((light[1:] > high) & (light[:-1] <= high))
    step = 1 / round(1 / (t_s[1] - t_s[0]))
    for k, falls in sorted([(int(k), True) for k in goes] + [(int(k), False) for k in comes]):
        if falls != lit:
            continue
        level = low if falls else high
        share = (light[k] - level) / (light[k] - light[k + 1])
        # Without hysteresis: where the light passes the threshold itself; the same path, so a local straight line.
        at = (light[k] - sensor.threshold) / (light[k] - light[k + 1])
        when = t_s[k] + step * share
        missed = rng.random() < missed_share if falls else missed
        if span_s[0] <= when < span_s[1] and not missed:
            stamps.append(when + sensor.response_s)
            levels.append(0 if falls else 1)
            ideal.append(t_s[k] + step * at)
        lit = not falls
    return np.array(stamps), np.array(levels), np.array(ideal)
