"""A run's movement as its touch trace shows it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from draglag.latency.estimate import Prepared
from draglag.latency.path import INDEPENDENT_S, Path, smooth_path
from draglag.latency.spectrum import (
    Events,
    Spectrum,
    corner_for_mean,
    corner_of,
    corner_of_strokes,
    events_of,
    spectrum_of,
)
from draglag.latency.steady import keeps_speed
from draglag.latency.tremor import Tremor, tremor_of
from draglag.path.events import contact_losses
from draglag.recording import FloatArray


@dataclass(frozen=True)
class Track:
    """Smooth path, tremor, and the effect of uneven speed.

    Attributes:
        path: for single places. mean_path: for the mean over the edges.
        tremor: on ``mean_path``. with_tremor: whether it counts as movement.
        uneven: advance of the trace per unit of dL/dln v (mm/s): velocity × ln(speed / ``usual_mm_s``), smoothed alike.
    """

    path: Path
    mean_path: Path
    tremor: Tremor | None
    with_tremor: bool
    uneven: Path
    usual_mm_s: float
    losses_s: FloatArray
    span_s: tuple[float, float]

    @property
    def edges_of_trace_s(self) -> FloatArray:
        return np.append(self.losses_s.ravel(), self.span_s)

    def at(self, t_s: FloatArray) -> FloatArray:
        return self.with_velocity(t_s)[0]

    def with_velocity(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Position, with tremor if it counts, and velocity, (m, 2)."""
        xy_mm, v_mm_s = self.mean_path.at(t_s), self.path.at(t_s, 1)
        if self.tremor is not None and self.with_tremor:
            xy_mm = xy_mm + self.tremor.at(t_s)
        return xy_mm, v_mm_s


def independent_places(path: Path, t_s: FloatArray) -> float:
    """Effective number of independent places among rising times (m,)."""
    m, variance = t_s.size, float(path.by_lag(np.zeros(1))[0])
    shared = variance * max(m, 1)
    for k in range(1, m):
        lag_s = t_s[k:] - t_s[:-k]
        if float(lag_s.min()) > INDEPENDENT_S:
            break
        shared += 2 * float(path.by_lag(lag_s).sum())
    return max(m**2 * variance / max(shared, variance), 1.0)


@dataclass(frozen=True)
class Smoothed:
    events: Events
    spectrum: Spectrum
    path: Path
    noise: float


def smoothed_of(ready: Prepared) -> Smoothed:
    """The smooth path of a run, and its spectrum."""
    events = events_of(ready.touch.t_s, ready.xy_mm)
    spectrum = spectrum_of(events)
    rhythm_hz, corner_hz, noise = (corner_of if keeps_speed(ready.run) else corner_of_strokes)(spectrum)
    return Smoothed(events, spectrum, smooth_path(events, rhythm_hz, corner_hz, noise), noise)


def track_of(ready: Prepared, smoothed: Smoothed | None = None) -> Track:
    """The track of a run; ``smoothed``: of the same run."""
    smoothed = smoothed or smoothed_of(ready)
    events, spectrum, path, noise = smoothed.events, smoothed.spectrum, smoothed.path, smoothed.noise
    rhythm_hz, corner_hz = path.rhythm_hz, path.corner_hz
    n = independent_places(path, ready.edges.t_s)
    mean_path = smooth_path(events, rhythm_hz, corner_for_mean(spectrum, rhythm_hz, corner_hz, noise, n), noise)
    t_s = events.t_s
    v_mm_s = path.at(t_s, 1)
    speed = np.hypot(v_mm_s[:, 0], v_mm_s[:, 1])
    usual = float(np.exp(np.mean(np.log(np.maximum(speed, 1e-3)))))
    relative = np.clip(np.log(np.maximum(speed, 1e-3) / usual), -1, 1)
    uneven = mean_path.like(v_mm_s * relative[:, None])
    tremor = tremor_of(events, path, v_mm_s, mean_path)
    return Track(path, mean_path, tremor, True, uneven, usual, contact_losses(t_s), (float(t_s[0]), float(t_s[-1])))
