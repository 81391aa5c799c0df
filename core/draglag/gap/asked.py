"""The speed that the law is asked at, behind the speed that a trace shows: of the same moment, or of another.

An event at t + L(v(t − d)) runs 1 + L′ v̇(t − d) times slower than the stylus: u = v / (1 + L′ v̇(t − d)). About a run's
speed v₀ that is v(t) + τ v̇(t − d) = u with τ = −v₀ L′. In frequencies it reads V (1 + iωτ e^{−iωd}) = U, a first-order
low-pass of the shown speed where d = 0. The law's speed is then v(t − d).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

from draglag.recording import FloatArray
from draglag.simulation.effects.lagging_law import USUAL_LATENCY_S

if TYPE_CHECKING:
    from draglag.gap.run_data import RunData

Law = Callable[[FloatArray], FloatArray]
Asked = tuple[float, float]
"""(which, delay_s): the speed of ``delay_s`` before, 0; or 1, of that times the latency over the usual one, so that
minus the usual latency is the speed of the moment of the report."""
NOW: Asked = (0.0, 0.0)
RESONANCE = 2.0  # by which a frequency may be amplified at the most: there is noise in it, too
PADDED_S = 2.0


def asked_speeds(runs: Sequence[RunData], law: Law, asked: Asked) -> list[tuple[FloatArray, FloatArray]]:
    """For each of some steady runs, times (g,) s on its trace and the speed that the law is asked at there, (g,) mm/s.

    A run of changing speed has no usual one: its edges are solved one by one.
    """
    usual = np.array([float(np.mean(data.quick[1])) for data in runs])
    slow = np.maximum(usual - 1.0, 0.0)
    slope = (law(usual + 1.0) - law(slow)) / (usual + 1.0 - slow)
    taus_s = np.maximum(-slope * usual, 0.0)
    if asked[1] == 0:
        return [_now(data, float(tau_s)) for data, tau_s in zip(runs, taus_s, strict=True)]
    delays_s = before_s(asked, law(usual))
    each = zip(runs, usual, taus_s, delays_s, strict=True)
    return [_steady(data, float(v), float(tau_s), float(delay_s)) for data, v, tau_s, delay_s in each]


def speed_apart(data: RunData, law: Law, asked: Asked) -> tuple[FloatArray, FloatArray]:
    """Times (g,) s on the trace and by how much the speed that the law is asked at differs from the one of that moment,
    (g,) mm/s, in a run of changing speed: to first order, as smooth as a hand's speed changes."""
    shown = data.shown
    around = np.maximum(shown.speed_mm_s, 1.0)
    slope = law(around + 0.5) - law(around - 0.5)
    change = np.gradient(shown.speed_mm_s, shown.step_s)
    own = shown.speed_mm_s * (1 + np.clip(slope * change, -0.3, 0.3))
    then = np.interp(shown.grid_s - before_s(asked, law(own)), shown.grid_s, own)
    return shown.grid_s, then - own


def before_s(asked: Asked, latency_s: FloatArray) -> FloatArray:
    """How long before each edge the speed is taken, (m,) s; negative: after it."""
    which, delay_s = asked
    return np.asarray(delay_s * (latency_s / USUAL_LATENCY_S if which else np.ones(np.shape(latency_s))))


def _now(data: RunData, tau_s: float) -> tuple[FloatArray, FloatArray]:
    grid_s, shown = data.quick
    step_s = grid_s[1] - grid_s[0]
    if tau_s < 0.1 * step_s:
        return grid_s, shown
    keep = float(np.exp(-step_s / tau_s))
    speed, _ = lfilter([1 - keep], [1, -keep], shown, zi=[keep * shown[0]])
    return grid_s + 0.5 * step_s, speed  # each step takes in what is shown at its end


def _steady(data: RunData, usual: float, tau_s: float, delay_s: float) -> tuple[FloatArray, FloatArray]:
    grid_s, shown = data.quick
    step_s = grid_s[1] - grid_s[0]
    padded = min(shown.size - 1, round(PADDED_S / step_s))
    off = np.pad(shown - usual, padded, mode="reflect")
    omega = 2 * np.pi * np.fft.rfftfreq(off.size, step_s)
    turned = np.exp(-1j * omega * delay_s)
    pole = 1 / (1 + 1j * omega * tau_s * turned)
    pole /= np.maximum(np.abs(pole) / RESONANCE, 1.0)
    speed = np.fft.irfft(np.fft.rfft(off) * pole * turned, off.size)[padded : padded + shown.size]
    return grid_s, np.maximum(speed + usual, 0.0)
