"""Effect of latency on a tracking task."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from draglag.path.inversion import Law
from draglag.protocol.targets import MULTISINE_AMPLITUDE, MULTISINE_INDEX, MULTISINE_PERIOD_S, MultiSine
from draglag.recording import FloatArray

GRID_HZ = 800.0


@dataclass(frozen=True)
class TrackingResponse:
    """First-harmonic response of the screen to a perfect hand, (11,) each; a lag has negative phase."""

    frequency_rad_s: FloatArray
    gain: FloatArray
    phase_deg: FloatArray
    delay_ms: FloatArray
    amplitude_mm: FloatArray

    def to_dict(self) -> list[dict[str, float]]:
        """One record a frequency."""
        return [
            {
                "frequency_rad_s": float(w),
                "amplitude_mm": float(a),
                "gain": float(g),
                "phase_deg": float(p),
                "delay_ms": float(d),
            }
            for w, a, g, p, d in zip(
                self.frequency_rad_s, self.amplitude_mm, self.gain, self.phase_deg, self.delay_ms, strict=True
            )
        ]


def tracking_response(law: Law, scale_mm: float = 24.4, sideways_mm_s: float = 4.0) -> TrackingResponse:
    """Fourier response to the multi-sine of Table 1; holds for this signal and size only.

    ``scale_mm``: one unit of amplitude.
    """
    n = round(MULTISINE_PERIOD_S * GRID_HZ)
    t_s = np.arange(n) / GRID_HZ
    target = MultiSine(0.0, 0.0, scale_mm, MULTISINE_PERIOD_S, sideways_mm_s)
    _, y_mm = target.position_mm(t_s)
    vx, vy = target.velocity_mm_s(t_s)
    # The trace is periodic: three periods, so that the middle one is complete. Later positions may be shown first.
    arrival_s = np.concatenate([t_s + k * MULTISINE_PERIOD_S for k in (-1, 0, 1)])
    arrival_s = arrival_s + np.tile(law(np.hypot(vx, vy)), 3)
    arrival_s = np.minimum.accumulate(arrival_s[::-1])[::-1] + 1e-12 * np.arange(3 * n)
    shown_mm = np.interp(t_s, arrival_s, np.tile(y_mm, 3))
    index = np.asarray(MULTISINE_INDEX)
    ratio = np.fft.rfft(shown_mm)[index] / np.fft.rfft(y_mm)[index]
    omega = 2 * np.pi * index / MULTISINE_PERIOD_S
    # Phases of neighbouring frequencies differ by less than half a turn: unwrap upwards from the slowest.
    phase = np.unwrap(np.angle(ratio))
    amplitude = scale_mm * np.asarray(MULTISINE_AMPLITUDE)
    return TrackingResponse(omega, np.abs(ratio), np.degrees(phase), -1e3 * phase / omega, amplitude)
