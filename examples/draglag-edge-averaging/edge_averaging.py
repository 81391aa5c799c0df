"""Near its side edges, where the signal is weak, a panel averages over more frames: the latency grows there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects import Effect, Parameter
from draglag.simulation.kinematics import Kinematics
from draglag.simulation.residual import LineGains, Signature, View, column


def _edgewise(panel_x: FloatArray) -> FloatArray:
    """(n,) from 0 in the middle of the panel to 1 at its side edges, by the square; panel_x: −1 … 1 across it."""
    return np.square(panel_x)


@dataclass(frozen=True)
class EdgeAveraging(Effect):
    """The latency grows towards the side edges of the panel."""

    id: ClassVar[str] = "edge_averaging"
    meaning: ClassVar[str] = "The latency grows towards both side edges of the panel, there by this much."
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("at_edge_s", "s", -0.05, 0.05, 0.01),)
    follows: ClassVar[str] = "x"
    where: ClassVar[str] = "towards the side edges"
    undone_in: ClassVar[str] = "touch"

    def latency(self, latency_s: FloatArray, k: Kinematics, rng: np.random.Generator) -> FloatArray:
        """What it does in the simulation: (n,) latency of every point of the motion."""
        return latency_s + self.value * _edgewise(2 * k.motion.x_mm / k.width_mm - 1)

    @classmethod
    def signatures(cls, view: View, gains: LineGains | None = None) -> list[Signature]:
        """How an effect of size 1 (here: 1 s at the edge) changes the latency of each measured edge."""
        return [Signature(latency=column(_edgewise(view.panel_x)))]
