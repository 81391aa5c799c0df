"""The return of the light is reported late."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from draglag.simulation.effects.base import Edges, Effect
from draglag.simulation.effects.parameter import Parameter
from draglag.simulation.residual import LineGains, Signature, View, column


@dataclass(frozen=True)
class LaserHysteresis(Effect):
    id: ClassVar[str] = "laser_hysteresis"
    meaning: ClassVar[str] = "The sensor reports the return of the light later than its loss by a constant."
    follows: ClassVar[str] = "kind_of_edge"
    where: ClassVar[str] = "edges where the beam becomes clear"
    undone_in: ClassVar[str] = "laser"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("delay_s", "s", -0.01, 0.01, 0.0018),)

    def edges(self, edges: Edges, rng: np.random.Generator) -> Edges:
        return Edges(edges.t_s + self.value * (edges.light == 1), edges.light)

    @classmethod
    def signatures(cls, view: View, gains: LineGains | None = None) -> list[Signature]:
        return [Signature(latency=column(-view.rising))]
