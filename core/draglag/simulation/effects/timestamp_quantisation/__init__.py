"""Touch stamps are coarse."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from draglag.simulation.effects.base import Effect, TouchEvents
from draglag.simulation.effects.parameter import Parameter


@dataclass(frozen=True)
class TimestampQuantisation(Effect):
    id: ClassVar[str] = "timestamp_quantisation"
    title: ClassVar[str] = "coarse time stamps"
    meaning: ClassVar[str] = "The stamps of touch events are rounded up to a multiple of a quantum."
    follows: ClassVar[str] = "frame"
    undone_in: ClassVar[str] = "stream"
    uneven_ages: ClassVar[bool] = True
    detected_by: ClassVar[str] = "draglag.simulation.effects.timestamp_quantisation.stream"
    detection_order: ClassVar[int] = 3
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("quantum_s", "s", 1e-06, 0.05, 0.004),)
    order: ClassVar[int] = 4

    def longest_wait_s(self, frame_s: float) -> float:
        return self.value

    def stamped_late_s(self) -> float:
        return 0.5 * self.value

    def events(self, events: TouchEvents, rng: np.random.Generator) -> TouchEvents:
        # a stamp that is a multiple already stays, whatever binary rounding made of it
        late = self.value * np.ceil(events.t_s / self.value - 1e-6)
        return TouchEvents(late, events.x_mm, events.y_mm, events.contact_id)
