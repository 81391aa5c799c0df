"""The laser's edges are stamped late by a constant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from draglag.simulation.effects.base import Edges, Effect
from draglag.simulation.effects.parameter import Parameter


@dataclass(frozen=True)
class ClockOffset(Effect):
    id: ClassVar[str] = "clock_offset"
    meaning: ClassVar[str] = "Every edge of the laser is stamped late by a constant that clock comparisons do not see."
    follows: ClassVar[str] = "taps"
    undone_in: ClassVar[str] = "laser"
    needs: ClassVar[str] = "taps"
    identifiable_with: ClassVar[str] = "taps timed on the same clock show it"
    laser_late: ClassVar[bool] = True
    drags_early: ClassVar[int] = 1
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("offset_s", "s", -0.1, 0.1, 0.005),)

    def edges(self, edges: Edges, rng: np.random.Generator) -> Edges:
        return Edges(edges.t_s + self.value, edges.light)
