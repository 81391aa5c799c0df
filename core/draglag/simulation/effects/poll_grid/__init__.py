"""Touch events wait for the host's next poll."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from draglag.simulation.effects.base import Effect, TouchEvents
from draglag.simulation.effects.parameter import Parameter


@dataclass(frozen=True)
class PollGrid(Effect):
    id: ClassVar[str] = "poll_grid"
    title: ClassVar[str] = "polling of the bus"
    meaning: ClassVar[str] = (
        "Touch events wait until the host asks for them, once in this period, and are stamped when they arrive."
    )
    follows: ClassVar[str] = "frame"
    where: ClassVar[str] = "every stamp"
    separated_by: ClassVar[str] = "a recording of the kernel's own stamps, without the loop of a program"
    undone_in: ClassVar[str] = "stream"
    detected_by: ClassVar[str] = "draglag.simulation.effects.poll_grid.stream"
    detection_order: ClassVar[int] = 1
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("period_s", "s", 1e-4, 0.05, 0.008),
        Parameter("jitter_s", "s", 0.0, 1e-3, 4e-5, read_as=("µs", 1e6)),
    )
    order: ClassVar[int] = 3

    jitter_s: float = 4e-5

    def longest_wait_s(self, frame_s: float) -> float:
        return self.value

    def stamped_late_s(self) -> float:
        return 0.5 * self.value

    def events(self, events: TouchEvents, rng: np.random.Generator) -> TouchEvents:
        period, phase = self.value, rng.uniform()
        polled = period * (np.ceil(events.t_s / period - phase) + phase)
        # an arrival is never early
        jitter = np.minimum(self.jitter_s * rng.standard_exponential(polled.size), 0.4 * period)
        late = np.maximum.accumulate(np.round(polled + jitter, 6))
        return TouchEvents(late, events.x_mm, events.y_mm, events.contact_id)
