"""One uninterrupted connection to a WALT."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from draglag_devices.clockmap import OnlineClockMap
from draglag_devices.walt.edges import EdgeCounter
from draglag_devices.walt.link import Link
from draglag_devices.walt.protocol import Unwrapped
from draglag_devices.walt.sync import Bound, as_bounds


@dataclass
class Connection:
    """State that is lost with the connection."""

    link: Link
    version: str
    epoch: int
    unwrapped: Unwrapped = field(default_factory=Unwrapped)
    clock_map: OnlineClockMap = field(default_factory=OnlineClockMap)
    edges: EdgeCounter = field(default_factory=EdgeCounter)
    rows: list[Bound] = field(default_factory=list)  # comparisons not handed on yet
    best_width_s: float = np.inf
    learnt_s: float = 0.0  # host time of the last comparison
    contradictions: int = 0
    unread: int = 0

    def learn(self, rows: list[Bound]) -> None:
        """Use comparisons of clocks."""
        if not rows:
            return
        self.rows.extend(rows)
        self.clock_map.add(as_bounds("", rows, self.epoch))
        self.unwrapped.advance(rows[-1].device_s)
        self.learnt_s = rows[-1].host_max_s
        self.best_width_s = min(self.best_width_s, *(row.width_s for row in rows))

    def host_s(self, device_s: float) -> float:
        return float(self.clock_map.to_host(np.array([device_s]))[0])
