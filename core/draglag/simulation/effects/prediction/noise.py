"""What the spectrum of the events' noise says about an extrapolation, which roughens noise."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from draglag.latency.spectrum import SEGMENT_S, events_of, spectrum_of
from draglag.recording import FloatArray, IntArray
from draglag.simulation.effects.prediction import STEP, WINDOW_S

if TYPE_CHECKING:
    from draglag.gap.traces.run_data import RunData

# Above the tremor's 8 to 12 Hz and its line's tails. Calibrated: of 14, 20 and 24 Hz the one above which most of 12
# simulated trackers are separated from an extrapolation: 7, 9 and 5, and of ten extrapolations none is refused.
FROM_HZ = 20.0
BANDS = 64  # of a run's spectrum, up to 8 Hz wide: finer than what an extrapolation makes of it. Derived
TAUS_S = (0.0, 0.003, 0.006, 0.012, 0.024, 0.048)  # of low-passes of the noise, in factors of two. Physical
HORIZONS_S = (0.005, 0.01, 0.015, 0.02, 0.03)  # of extrapolations. Physical (fact sheet on real screens)
WINDOWS_S = (WINDOW_S / STEP, WINDOW_S, WINDOW_S * STEP)  # of their velocities
FLOORS = (0.0, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0)  # of white noise, per unit of what is not white. Derived


@dataclass(frozen=True)
class Noise:
    """Spectra of all runs above the tremor in bands (k,): ``power`` is the mean of ``count`` independent values.

    interval_s: between events. run: number of the run.
    """

    f_hz: FloatArray
    interval_s: FloatArray
    power: FloatArray
    count: FloatArray
    run: IntArray

    def misfit(self, shape: FloatArray) -> float:
        """Least deviance (Whittle 1953) of noise with this spectrum (k,) and white noise next to it, as large in each
        run as it likes."""
        total = np.bincount(self.run, self.count)
        least = np.inf
        for floor in FLOORS:
            share = self.power / (shape + floor)
            share /= (np.bincount(self.run, self.count * share) / total)[self.run]
            least = min(least, -2 * float(self.count @ np.log(share)))
        return least

    def smoothed(self, tau_s: float) -> FloatArray:
        """Spectrum (k,) of white noise behind a first-order low-pass."""
        keep = np.exp(-self.interval_s / tau_s) if tau_s else np.zeros(self.f_hz.size)
        return np.asarray(np.abs((1 - keep) / (1 - keep * self._turn(1.0))) ** 2)

    def extrapolated(self, horizon_s: float, span_s: FloatArray) -> FloatArray:
        """Factor (k,) of an extrapolation by the velocity over ``span_s`` (k,), at least one interval."""
        steps = np.ceil(span_s / self.interval_s - 1e-9)
        later = steps - span_s / self.interval_s
        back = (1 - later) * self._turn(steps) + later * self._turn(steps - 1)
        return np.asarray(np.abs(1 + horizon_s / span_s * (1 - back)) ** 2)

    def spans_s(self, window_s: float) -> tuple[FloatArray, ...]:
        """What a window may be in events (k,): their own number, and the whole ones below and above."""
        whole = np.maximum(np.floor(window_s / self.interval_s + 1e-9), 1)
        return np.maximum(window_s, self.interval_s), whole * self.interval_s, (whole + 1) * self.interval_s

    def _turn(self, steps: float | FloatArray) -> np.ndarray:
        """Phase factor (k,) of a delay by so many events."""
        return np.asarray(np.exp(-2j * np.pi * self.f_hz * self.interval_s * steps))


@lru_cache(maxsize=2)
def nats_against(runs: tuple[RunData, ...]) -> float:
    """Nats by which noise behind a low-pass of first or second order, as trackers are, fits the events' spectra better
    than extrapolated noise, white or behind one of first order.

    Quasi-likelihood: per mean deviance of the better one, where that is more than noise has (McCullagh & Nelder 1989).
    0 without a spectrum.
    """
    noise = _noise_of(runs)
    free = noise.f_hz.size - np.unique(noise.run).size
    if free < 1:
        return 0.0
    once = [noise.smoothed(tau_s) for tau_s in TAUS_S]
    spans = [span_s for window_s in WINDOWS_S for span_s in noise.spans_s(window_s)]
    rough = [noise.extrapolated(*setting) for setting in product(HORIZONS_S, spans)]
    smooth = min(noise.misfit(one) for one in (*once, *(one**2 for one in once)))
    extrapolated = min(noise.misfit(one * by) for one, by in product(once, rough))
    return 0.5 * (extrapolated - smooth) / max(1.0, min(extrapolated, smooth) / free)


def _noise_of(runs: tuple[RunData, ...]) -> Noise:
    f_hz, interval_s, power, count, number = [], [], [], [], []
    for k, data in enumerate(runs):
        found = spectrum_of(events_of(data.t_s, data.xy_mm))
        quiet = np.flatnonzero((found.f_hz >= FROM_HZ) & (found.f_hz < found.f_hz[-1]) & (found.power > 0))
        if not quiet.size:
            continue
        bands = np.array_split(quiet, min(BANDS, quiet.size))
        f_hz += [float(found.f_hz[band].mean()) for band in bands]
        power += [float(found.power[band].mean()) for band in bands]
        # Of two axes, in segments that overlap by a half; the taper makes two neighbouring frequencies alike.
        count += [2 * float(np.ptp(data.t_s)) / SEGMENT_S * band.size for band in bands]
        interval_s += [found.dt_s] * len(bands)
        number += [k] * len(bands)
    run = np.unique(np.array(number, np.int64), return_inverse=True)[1].astype(np.int64)
    return Noise(np.array(f_hz), np.array(interval_s), np.array(power), np.array(count), run)
