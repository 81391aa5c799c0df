"""Edges from the WALT's laser lines."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from draglag.recording import LaserTrace
from draglag_devices.walt.link import Link
from draglag_devices.walt.protocol import LASER_LAST


@dataclass
class EdgeCounter:
    """The edges of one connection.

    A line with ``count`` n stands for n edges, the last one stamped. Two lines of one value mean a lost line between.

    ``before``: edges before the first line could come, included in its count.
    """

    last_value: int | None = None
    last_s: float | None = None
    before: int = 0

    def take(
        self,
        lines: Sequence[tuple[float, int, int]],
        host_s: Callable[[float], float],
        plausible_s: tuple[float, float],
        epoch: int,
    ) -> LaserTrace:
        """Edges, and marked losses, of lines (device seconds, value, count).

        ``plausible_s``: possible host times; other lines were damaged on the wire.
        """
        edges: list[tuple[float, int, float]] = []
        gaps: list[tuple[float, float]] = []
        missed = 0
        for device_s, value, count in lines:
            at_s = host_s(device_s)
            if not plausible_s[0] <= at_s <= plausible_s[1] or value not in (0, 1) or count < 1:
                continue  # the next line has the same value
            if count > self.before:
                count -= self.before
            self.before = 0
            lost = count - 1
            if self.last_value is not None and (count + value - self.last_value) % 2:
                lost += 1
            if lost:
                missed += lost
                gaps.append((at_s if self.last_s is None else self.last_s, at_s))
            edges.append((at_s, value, device_s))
            self.last_value, self.last_s = value, at_s
        table = np.array(edges).reshape(-1, 3)
        return LaserTrace(
            table[:, 0],
            table[:, 1].astype(np.int64),
            table[:, 2],
            np.full(len(table), epoch, np.int64),
            np.array(gaps).reshape(-1, 2),
            missed,
        )


def counted_so_far(link: Link) -> EdgeCounter:
    """A counter with the edges since the reset."""
    link.send(LASER_LAST)
    link.settle()
    lines = [trigger for trigger in link.take_triggers() if trigger.tag == "L"]
    if not lines or (lines[-1].us == 0 and lines[-1].count == 0):
        return EdgeCounter()
    return EdgeCounter(last_value=lines[-1].value, before=max(0, lines[-1].count))
