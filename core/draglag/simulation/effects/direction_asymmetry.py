"""Latency differs between down and up."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Effect
from draglag.simulation.effects.parameter import Parameter
from draglag.simulation.kinematics import Kinematics
from draglag.simulation.residual import LineGains, Signature, View, column


@dataclass(frozen=True)
class DirectionAsymmetry(Effect):
    id: ClassVar[str] = "direction_asymmetry"
    meaning: ClassVar[str] = (
        "The latency is larger by this much when the stylus moves down the screen than when it moves "
        "up: half is added one way and half taken off the other."
    )
    follows: ClassVar[str] = "direction"
    where: ClassVar[str] = "down against up"
    separated_by: ClassVar[str] = "circles whose centre lies 30 mm off the beam"
    undone_in: ClassVar[str] = "touch"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("difference_s", "s", -0.05, 0.05, 0.006),)

    def latency(self, latency_s: FloatArray, k: Kinematics, rng: np.random.Generator) -> FloatArray:
        return latency_s + 0.5 * self.value * np.sign(k.motion.vy_mm_s)

    @classmethod
    def signatures(cls, view: View, gains: LineGains | None = None) -> list[Signature]:
        # Between moving down and moving up, half each way.
        return [Signature(latency=column(0.5 * np.sign(view.v_across)))]
