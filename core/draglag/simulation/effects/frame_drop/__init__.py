"""Touch frames get lost."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from draglag.simulation.effects.base import Effect, TouchEvents
from draglag.simulation.effects.parameter import PER_CENT, Parameter


@dataclass(frozen=True)
class FrameDrop(Effect):
    id: ClassVar[str] = "frame_drop"
    title: ClassVar[str] = "dropped frames"
    meaning: ClassVar[str] = "This share of the touch frames never arrives, each independently of the others."
    follows: ClassVar[str] = "frame"
    in_measured_streams: ClassVar[bool] = True
    detected_by: ClassVar[str] = "draglag.simulation.effects.frame_drop.stream"
    detection_order: ClassVar[int] = 5
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("share", "1", 0.0, 0.9, 0.1, read_as=PER_CENT),)
    order: ClassVar[int] = 2

    def events(self, events: TouchEvents, rng: np.random.Generator) -> TouchEvents:
        return events.take(rng.uniform(size=len(events.t_s)) >= self.value)
