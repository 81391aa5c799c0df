"""The host reads the last event in a loop."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Effect, TouchEvents
from draglag.simulation.effects.parameter import Parameter


@dataclass(frozen=True)
class SampleHold(Effect):
    id: ClassVar[str] = "sample_hold"
    title: ClassVar[str] = "sample and hold"
    meaning: ClassVar[str] = (
        "The host runs a loop at this rate and records the last event at every tick, stamped with the tick."
    )
    in_detail: ClassVar[str] = "A row at every tick, also where nothing is new."
    follows: ClassVar[str] = "host_tick"
    undone_in: ClassVar[str] = "stream"
    uneven_ages: ClassVar[bool] = True
    estimated_with: ClassVar[bool] = True
    detected_by: ClassVar[str] = "draglag.simulation.effects.sample_hold.stream"
    detection_order: ClassVar[int] = 4
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("rate_hz", "Hz", 10.0, 2000.0, 100.0),)
    order: ClassVar[int] = 5

    def longest_wait_s(self, frame_s: float) -> float:
        return 1 / self.value

    def stamped_late_s(self) -> float:
        return 0.5 / self.value

    def events(self, events: TouchEvents, rng: np.random.Generator) -> TouchEvents:
        if len(events.t_s) == 0:
            return events
        period = 1 / self.value
        phase = rng.uniform()
        first, last = np.ceil(events.t_s[[0, -1]] / period - phase)
        ticks = np.round((np.arange(first, last) + phase) * period, 6)
        index = np.searchsorted(events.t_s, ticks, side="right") - 1
        present = index >= 0
        # between two contacts there is nothing to hold: the event must be younger than 0.1 s
        present[present] = ticks[present] - events.t_s[index[present]] < 0.1
        now = events.take(index[present])
        return TouchEvents(ticks[present], now.x_mm, now.y_mm, now.contact_id)

    @classmethod
    def first_shown_s(cls, t_s: FloatArray, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray | None:
        repeats = np.append(False, (np.diff(x_mm) == 0) & (np.diff(y_mm) == 0))
        first = np.maximum.accumulate(np.where(repeats, 0, np.arange(t_s.size)))
        return np.asarray(t_s[first])
