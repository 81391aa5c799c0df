"""The digitiser's latency creeps while it warms up."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Effect
from draglag.simulation.effects.parameter import Parameter
from draglag.simulation.kinematics import Kinematics


@dataclass(frozen=True)
class ThermalDrift(Effect):
    id: ClassVar[str] = "thermal_drift"
    meaning: ClassVar[str] = (
        "The latency itself creeps, linearly with the time since the session began, for taps as for drags."
    )
    follows: ClassVar[str] = "session_time"
    where: ClassVar[str] = "growing with session time"
    per_term: ClassVar[float] = -3600.0
    shares_column_of: ClassVar[str] = "clock_drift"
    separated_by: ClassVar[str] = "taps before and after the runs separate a drifting clock from a creeping latency"
    undone_in: ClassVar[str] = "touch"
    needs: ClassVar[str] = "taps"
    identifiable_with: ClassVar[str] = (
        "taps before and after the runs separate a drifting clock from a creeping latency"
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("creep_s_per_h", "s/h", -0.5, 0.5, 0.04, title="creep"),)

    def latency(self, latency_s: FloatArray, k: Kinematics, rng: np.random.Generator) -> FloatArray:
        return latency_s + self.value * k.session_s / 3600

    def tap_latency(self, latency_s: FloatArray, t_s: FloatArray) -> FloatArray:
        return latency_s + self.value * t_s / 3600
