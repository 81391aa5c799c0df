"""What a session's sources share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np

from draglag.protocol.runs import PlannedRun
from draglag.protocol.targets import Tap
from draglag.recording import TouchTrace
from draglag_devices.source import ContactChanges
from draglag_devices.timebase import HostTime, TimeBase
from draglag_devices.timeline import Timeline


class Player(Protocol):
    """Follows the session's targets: the simulated hand, or a tape."""

    timelines: dict[str, Timeline]

    def begin_run(self, planned: PlannedRun, start_s: float, run_id: str) -> None:
        """The target moves from the host time ``start_s`` on."""
        ...

    def begin_taps(self, tap: Tap, start_s: float) -> None:
        """The participant is asked to tap from ``start_s`` on."""
        ...

    def stop(self) -> None:
        """The target is gone: drop samples not yet released."""
        ...


@runtime_checkable
class TouchesTargets(Protocol):
    """A player that touches calibration targets; recordings cannot."""

    def begin_touch(self, x_mm: float, y_mm: float, start_s: float) -> None:
        """Touch there from ``start_s`` on."""
        ...


@dataclass
class Stage:
    """Shared by a session's sources.

    ``players``: by a key such as a tape's path, which joins its touch and laser.
    """

    time_base: TimeBase = field(default_factory=HostTime)
    screen_name: str = "screen-1"
    seed: int = 0
    players: dict[str, Player] = field(default_factory=dict)

    def player(self, key: str, make: Callable[[], Player]) -> Player:
        """The player of that key, made at first use."""
        if key not in self.players:
            self.players[key] = make()
        return self.players[key]

    def begin_run(self, planned: PlannedRun, start_s: float, run_id: str) -> None:
        for player in self.players.values():
            player.begin_run(planned, start_s, run_id)

    def begin_taps(self, tap: Tap, start_s: float) -> None:
        for player in self.players.values():
            player.begin_taps(tap, start_s)

    def begin_touch(self, x_mm: float, y_mm: float, start_s: float) -> None:
        """Have players touch there, where they can."""
        for player in self.players.values():
            if isinstance(player, TouchesTargets):
                player.begin_touch(x_mm, y_mm, start_s)

    def stop(self) -> None:
        for player in self.players.values():
            player.stop()


def contact_changes(touch: TouchTrace, lift_after_s: float) -> ContactChanges:
    """Beginnings and ends of contacts, these ``lift_after_s`` late."""
    n = len(touch.t_s)
    if n == 0:
        return ContactChanges(np.empty(0), np.empty(0, np.int64), np.empty(0, np.int64))
    ids = touch.contact_id if len(touch.contact_id) == n else np.zeros(n, np.int64)
    first = np.flatnonzero(np.concatenate(([True], ids[1:] != ids[:-1])))
    last = np.append(first[1:], n) - 1
    ends_s = touch.t_s[last] + lift_after_s
    # A new contact cannot begin before the one before it has ended.
    ends_s[:-1] = np.minimum(ends_s[:-1], touch.t_s[first[1:]])
    t_s = np.column_stack([touch.t_s[first], ends_s]).ravel()
    down = np.tile(np.array([1, 0], np.int64), len(first))
    return ContactChanges(t_s, np.repeat(ids[first], 2), down)
