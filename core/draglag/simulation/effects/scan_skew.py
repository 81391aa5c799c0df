"""The panel is scanned column by column."""

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
class ScanSkew(Effect):
    id: ClassVar[str] = "scan_skew"
    meaning: ClassVar[str] = (
        "The latency grows linearly across the panel in scan order: by this much from its left edge "
        "to its right, half of it either side of the mean."
    )
    follows: ClassVar[str] = "x"
    where: ClassVar[str] = "growing across the panel"
    undone_in: ClassVar[str] = "touch"
    needs: ClassVar[str] = "width"
    identifiable_with: ClassVar[str] = "circles that travel across the whole width show it"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("across_s", "s", -0.05, 0.05, 0.008, title="across the panel"),
    )

    def latency(self, latency_s: FloatArray, k: Kinematics, rng: np.random.Generator) -> FloatArray:
        return latency_s + self.value * (k.motion.x_mm / k.width_mm - 0.5)

    @classmethod
    def signatures(cls, view: View, gains: LineGains | None = None) -> list[Signature]:
        return [Signature(latency=column(0.5 * view.panel_x))]
