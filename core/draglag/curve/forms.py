"""The forms of L(v), linear in amplitudes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from draglag.recording import FloatArray

Columns = Callable[[FloatArray, FloatArray], FloatArray]

SLOWEST_RATE, FASTEST_RATE = 3e-4, 0.15  # s/mm: decays over 3.3 m/s … 7 mm/s, wider than any panel's
RATE_GRID = np.geomspace(5e-4, 0.1, 22)
AT_REST_MM_S = 1.0  # slower, a stylus rests: a power of the speed rises no further
SCALE_MM_S = 100.0  # speed at which a power's amplitude is given: a usual drag


@dataclass(frozen=True)
class Form:
    """One family of curves.

    Attributes:
        shape_names, amplitude_names: JSON names; non-negative amplitudes in ms unless the name says otherwise.
        columns: (θ (g, k), v (n,) mm/s) → (g, n, p): L = columns @ amplitudes.
        grid: (g, k) starting points. lower, upper: (k,) bounds of θ.
    """

    name: str
    title: str
    shape_names: tuple[str, ...]
    amplitude_names: tuple[str, ...]
    columns: Columns
    grid: FloatArray
    lower: FloatArray
    upper: FloatArray

    @property
    def n_parameters(self) -> int:
        return len(self.shape_names) + len(self.amplitude_names)

    @property
    def names(self) -> tuple[str, ...]:
        return self.shape_names + self.amplitude_names


def _constant(theta: FloatArray, v: FloatArray) -> FloatArray:
    return np.ones((theta.shape[0], v.size, 1))


def _exponential(theta: FloatArray, v: FloatArray) -> FloatArray:
    decay = np.exp(-theta[:, :1] * v)
    return np.stack([decay, np.ones_like(decay)], axis=2)


def _double(theta: FloatArray, v: FloatArray) -> FloatArray:
    fast, slow = np.exp(-theta[:, :1] * v), np.exp(-theta[:, 1:2] * v)
    return np.stack([fast, slow, np.ones_like(fast)], axis=2)


def _double_plateau(theta: FloatArray, v: FloatArray) -> FloatArray:
    return _double(theta, np.maximum(v, theta[:, 2:3]))


def _low_pass(theta: FloatArray, v: FloatArray) -> FloatArray:
    slow = 1e3 / (2 * np.pi * (theta[:, :1] + v))
    return np.stack([slow, np.ones_like(slow)], axis=2)


def _power(theta: FloatArray, v: FloatArray) -> FloatArray:
    falling = (np.maximum(v, AT_REST_MM_S) / SCALE_MM_S) ** -theta[:, :1]
    return np.stack([falling, np.ones_like(falling)], axis=2)


_PAIRS = np.array([(a, b) for i, a in enumerate(RATE_GRID) for b in RATE_GRID[i + 2 :]])
_PLATEAUS = np.array([60.0, 80.0, 100.0, 125.0, 155.0, 190.0, 240.0])
_RATES = (np.array([SLOWEST_RATE] * 2), np.array([FASTEST_RATE] * 2))

FORMS: dict[str, Form] = {
    form.name: form
    for form in (
        Form("constant", "constant", (), ("a7_ms",), _constant, np.empty((1, 0)), np.empty(0), np.empty(0)),
        Form(
            "single_exponential",
            "one exponential",
            ("a2_s_per_mm",),
            ("a1_ms", "a7_ms"),
            _exponential,
            RATE_GRID[:, None],
            _RATES[0][:1],
            _RATES[1][:1],
        ),
        Form(
            "double_exponential",
            "Eq. 5: two exponentials",
            ("a2_s_per_mm", "a5_s_per_mm"),
            ("a1_ms", "a4_ms", "a7_ms"),
            _double,
            _PAIRS,
            *_RATES,
        ),
        Form(
            "double_exponential_plateau",
            "Eq. 5 with a plateau at low speed",
            ("a2_s_per_mm", "a5_s_per_mm", "plateau_mm_s"),
            ("a1_ms", "a4_ms", "a7_ms"),
            _double_plateau,
            np.array([(*p, v) for v in _PLATEAUS for p in _PAIRS[::2]]),
            np.append(_RATES[0], 10.0),
            np.append(_RATES[1], 400.0),
        ),
        # L0 + 1 / (2π (f0 + β v)) with θ = f0 / β and amplitude 1 / β.
        Form(
            "adaptive_low_pass",
            "low-pass whose corner rises with speed",
            ("corner_speed_mm_s",),
            ("inverse_beta_mm", "l0_ms"),
            _low_pass,
            np.geomspace(1.0, 2000.0, 24)[:, None],
            np.array([0.1]),
            np.array([2e4]),
        ),
        Form(
            "power",
            "power of the speed",
            ("exponent",),
            ("at_100_mm_s_ms", "l0_ms"),
            _power,
            np.geomspace(0.1, 2.0, 12)[:, None],
            np.array([0.05]),
            np.array([3.0]),
        ),
    )
}
