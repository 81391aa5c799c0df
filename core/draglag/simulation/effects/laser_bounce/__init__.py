"""The sensor chatters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from draglag.simulation.effects.base import Edges, Effect
from draglag.simulation.effects.parameter import PER_CENT, Parameter


@dataclass(frozen=True)
class LaserBounce(Effect):
    id: ClassVar[str] = "laser_bounce"
    meaning: ClassVar[str] = "After some edges the sensor chatters: it flips back and forth once within a short time."
    follows: ClassVar[str] = "kind_of_edge"
    undone_in: ClassVar[str] = "stream"
    in_measured_streams: ClassVar[bool] = True
    detected_by: ClassVar[str] = "draglag.simulation.effects.laser_bounce.stream"
    detection_order: ClassVar[int] = 0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("share", "1", 0.0, 1.0, 0.1, read_as=PER_CENT),
        Parameter("span_s", "s", 1e-05, 0.005, 0.001),
    )
    order: ClassVar[int] = 1

    span_s: float = 0.001

    def edges(self, edges: Edges, rng: np.random.Generator) -> Edges:
        bounces = rng.uniform(size=len(edges.t_s)) < self.value
        back, again = np.sort(rng.uniform(0.0, self.span_s, (2, len(edges.t_s))), axis=0)
        t, light = edges.t_s[bounces], edges.light[bounces]
        return Edges(
            np.concatenate([edges.t_s, t + back[bounces], t + again[bounces]]),
            np.concatenate([edges.light, 1 - light, light]),
        )
