"""The 1 euro filter (Casiez et al. 2012) and its inverse.

y_i = y_{i-1} + g_i (x_i − y_{i-1}), gain g_i by the cut-off fmin + β |v_i|, v the raw velocity behind a low-pass of 1
Hz.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from draglag.path.recursion import recursion
from draglag.recording import FloatArray

DERIVATIVE_HZ = 1.0  # cut-off of the low-pass on the velocity, as published
SHORTEST_S = 1e-4  # between two events
EXACT_MM = 1e-4  # of a position: where the inverse has come to its end
MOST_ROUNDS = 60  # twice what the fastest circles behind the slowest filter need


class Setting(NamedTuple):
    """Cut-off at rest and its rise with speed; in a fit also standard deviations of their logarithms."""

    fmin_hz: float
    beta_per_mm: float
    sd_log_fmin: float = 0.0
    sd_log_beta: float = 0.0

    @property
    def unsure(self) -> tuple[float, float]:
        return self.sd_log_fmin, self.sd_log_beta

    def logs_from(self, other: Setting) -> FloatArray:
        """Logarithms of both parameters over another's, (2,)."""
        return np.log([self.fmin_hz / other.fmin_hz, self.beta_per_mm / other.beta_per_mm])

    def moved(self, logs: FloatArray) -> Setting:
        """Setting changed by (2,) in the logarithms."""
        return Setting(self.fmin_hz * float(np.exp(logs[0])), self.beta_per_mm * float(np.exp(logs[1])))


def filtered(t_s: FloatArray, xy_mm: FloatArray, setting: Setting, begins: np.ndarray) -> FloatArray:
    """Filtered positions (n, 2). begins: (n,) first events of contacts."""
    turn = _turns(t_s, xy_mm, setting, begins)
    gain = np.where(begins, 1.0, turn / (1 + turn))
    return recursion(1 - gain, gain[:, None] * xy_mm)


def unfiltered(t_s: FloatArray, xy_mm: FloatArray, setting: Setting, begins: np.ndarray) -> FloatArray:
    """Raw positions (n, 2) of filtered ones; noise added behind the filter, as by rounding, grows by 1 / gain."""
    before = np.vstack([xy_mm[:1], xy_mm[:-1]])
    steps = np.where(begins[:, None], 0.0, xy_mm - before)
    raw = xy_mm
    for _ in range(MOST_ROUNDS):
        again = xy_mm + steps / _turns(t_s, raw, setting, begins)[:, None]
        change = float(np.max(np.abs(again - raw), initial=0.0))
        raw = again
        if not change > EXACT_MM:
            break
    return raw


def cut_off_hz(t_s: FloatArray, raw_mm: FloatArray, setting: Setting, begins: np.ndarray) -> FloatArray:
    """Cut-off at each event, (n,)."""
    step_s = _steps_s(t_s)
    turn = 2 * np.pi * DERIVATIVE_HZ * step_s
    keep = np.where(begins, 1.0, turn / (1 + turn))
    change = np.where(begins[:, None], 0.0, np.diff(raw_mm, axis=0, prepend=raw_mm[:1]) / step_s[:, None])
    velocity = recursion(1 - keep, keep[:, None] * change)
    return np.asarray(setting.fmin_hz + setting.beta_per_mm * np.hypot(velocity[:, 0], velocity[:, 1]))


def _turns(t_s: FloatArray, raw_mm: FloatArray, setting: Setting, begins: np.ndarray) -> FloatArray:
    """Gain / (1 − gain), (n,)."""
    return np.asarray(2 * np.pi * _steps_s(t_s) * cut_off_hz(t_s, raw_mm, setting, begins))


def _steps_s(t_s: FloatArray) -> FloatArray:
    return np.maximum(np.diff(t_s, prepend=t_s[:1]), SHORTEST_S)
