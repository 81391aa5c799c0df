"""The digitiser loses the stylus and the host may fill the gap."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from draglag.simulation.effects.base import Effect, TouchEvents
from draglag.simulation.effects.parameter import Parameter


@dataclass(frozen=True)
class LossOfContact(Effect):
    id: ClassVar[str] = "loss_of_contact"
    meaning: ClassVar[str] = (
        "The digitiser loses the stylus now and then; the host fills each gap with a straight line at"
        " the usual rate (filled = 1) or leaves it (0)."
    )
    follows: ClassVar[str] = "frame"
    undone_in: ClassVar[str] = "stream"
    in_measured_streams: ClassVar[bool] = True
    detected_by: ClassVar[str] = "draglag.simulation.effects.loss_of_contact.stream"
    detection_order: ClassVar[int] = 7
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("losses_per_min", "1/min", 0.0, 120.0, 6.0, title="losses"),
        Parameter("duration_s", "s", 0.02, 2.0, 0.15),
        Parameter("filled", "1", 0.0, 1.0, 1.0),
    )
    order: ClassVar[int] = 1

    duration_s: float = 0.15
    filled: float = 1.0

    def events(self, events: TouchEvents, rng: np.random.Generator) -> TouchEvents:
        t = events.t_s
        if len(t) < 3:
            return events
        starts = rng.uniform(t[0], t[-1], rng.poisson(self.value * (t[-1] - t[0]) / 60))
        lost = np.zeros(len(t), bool)
        for start in starts:
            lost |= (t > start) & (t < start + self.duration_s)
        lost[[0, -1]] = False
        if self.filled >= 0.5:
            x = np.where(lost, np.interp(t, t[~lost], events.x_mm[~lost]), events.x_mm)
            y = np.where(lost, np.interp(t, t[~lost], events.y_mm[~lost]), events.y_mm)
            return TouchEvents(t, x, y, events.contact_id)
        returned = np.cumsum(np.diff(lost.astype(np.int64), prepend=0) < 0)
        left = TouchEvents(t, events.x_mm, events.y_mm, events.contact_id + returned)
        return left.take(~lost)
