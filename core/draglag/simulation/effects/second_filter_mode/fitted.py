"""A fitted second filter, by acceleration or times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.fitted_shape import FittedShape
from draglag.simulation.effects.second_filter_mode.setting import Setting
from draglag.simulation.kinematics import Kinematics


@dataclass(frozen=True)
class FittedMode(FittedShape):
    """sizes: lateness, s."""

    def latency(self, latency_s: FloatArray, k: Kinematics, rng: np.random.Generator) -> FloatArray:
        setting = Setting.of(self.theta)
        if setting is None:
            return latency_s
        if setting.timed:
            return np.asarray(latency_s + self.sizes[0] * setting.within(k.session_s, latency_s))
        return latency_s + self.sizes[0] * (np.abs(k.tangential_mm_s2) > setting.above)
