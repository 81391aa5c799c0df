"""Touch frames arrive in groups."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from draglag.simulation.effects.base import Effect, TouchEvents
from draglag.simulation.effects.parameter import Parameter


@dataclass(frozen=True)
class FrameBatching(Effect):
    id: ClassVar[str] = "frame_batching"
    meaning: ClassVar[str] = (
        "Touch frames are delivered in groups of this many, all stamped when the last of them arrives, 20 µs apart."
    )
    follows: ClassVar[str] = "frame"
    undone_in: ClassVar[str] = "stream"
    detected_by: ClassVar[str] = "draglag.simulation.effects.frame_batching.stream"
    detection_order: ClassVar[int] = 2
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("frames", "1", 1.0, 20.0, 2.0, whole=True),)
    order: ClassVar[int] = 3

    def longest_wait_s(self, frame_s: float) -> float:
        return self.value * frame_s

    def events(self, events: TouchEvents, rng: np.random.Generator) -> TouchEvents:
        n, size = len(events.t_s), round(self.value)
        first = int(rng.integers(size))  # where in a group the run begins
        group = (np.arange(n) + first) // size
        last = np.searchsorted(group, group, side="right") - 1
        late = events.t_s[last] - 20e-6 * (last - np.arange(n))
        return TouchEvents(np.maximum(late, events.t_s), events.x_mm, events.y_mm, events.contact_id)
