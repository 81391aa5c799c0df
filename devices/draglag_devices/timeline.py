"""Samples known ahead (simulated or recorded), released at their time."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from typing import Any, TypeVar

import numpy as np

from draglag.recording import ClockBounds, FloatArray, LaserTrace, Taps, TouchTrace, concatenate
from draglag_devices.clockmap import OnlineClockMap
from draglag_devices.source import Batch, ContactChanges, Notice, SourceInfo
from draglag_devices.timebase import TimeBase

_Samples = TypeVar("_Samples", TouchTrace, LaserTrace, Taps, ClockBounds, ContactChanges)

# How much simulated time one read covers when time runs as fast as the computer allows.
CHUNK_S = 0.25
# In real time a read returns at least this often, so that live plots move.
_REAL_READ_S = 0.04


def sample_times(
    samples: TouchTrace | LaserTrace | Taps | ClockBounds | ContactChanges,
) -> np.ndarray[Any, Any]:
    """Host time at which each sample becomes known, (n,)."""
    if isinstance(samples, Taps):
        return samples.physical_s
    if isinstance(samples, ClockBounds):
        return samples.host_max_s
    return samples.t_s


def part(samples: _Samples, first: int, last: int) -> _Samples:
    """Samples ``first`` to before ``last``; the first part has counts and gaps."""
    n = len(sample_times(samples))
    changed: dict[str, Any] = {}
    for spec in fields(samples):
        value = getattr(samples, spec.name)
        if spec.name == "gaps_s":
            changed[spec.name] = value if first == 0 else value[:0]
        elif isinstance(value, np.ndarray) and len(value) == n:
            changed[spec.name] = value[first:last]
        elif spec.name in ("dropped", "missed") and first > 0:
            changed[spec.name] = 0
        elif spec.name == "rejected" and first > 0:
            changed[spec.name] = {}
    return replace(samples, **changed)


@dataclass
class _Lane:
    pending: list[Any] = field(default_factory=list)

    def add(self, samples: Any) -> None:
        if len(sample_times(samples)) or getattr(samples, "dropped", 0) or getattr(samples, "missed", 0):
            self.pending.append(samples)

    def take(self, until_s: float) -> Any | None:
        taken: list[Any] = []
        while self.pending:
            head = self.pending[0]
            times = sample_times(head)
            count = int(np.searchsorted(times, until_s, side="right"))
            if count == len(times):
                taken.append(self.pending.pop(0))
                continue
            if count:
                taken.append(part(head, 0, count))
                self.pending[0] = part(head, count, len(times))
            break
        if not taken:
            return None
        return taken[0] if len(taken) == 1 else _join(taken)


def _join(parts: list[Any]) -> Any:
    if isinstance(parts[0], ContactChanges):
        columns = [np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(ContactChanges)]
        return ContactChanges(*columns)
    return concatenate(parts)


class Timeline:
    """Future samples of one source. Thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._lanes = {name: _Lane() for name in ("touch", "laser", "taps", "clock", "contacts")}
        self._notices: list[Notice] = []
        self.given_until_s = -np.inf

    def add(
        self,
        *,
        touch: TouchTrace | None = None,
        laser: LaserTrace | None = None,
        taps: Taps | None = None,
        clock: ClockBounds | None = None,
        contacts: ContactChanges | None = None,
        notices: tuple[Notice, ...] = (),
    ) -> None:
        """Append samples; each kind in order of time."""
        with self._lock:
            for name, samples in (
                ("touch", touch), ("laser", laser), ("taps", taps), ("clock", clock), ("contacts", contacts)
            ):  # fmt: skip
                if samples is not None:
                    self._lanes[name].add(samples)
            self._notices.extend(notices)

    def cut(self) -> None:
        """Drop what has not been released."""
        with self._lock:
            for lane in self._lanes.values():
                lane.pending.clear()
            self._notices.clear()

    def take(self, until_s: float) -> Batch:
        """Samples up to ``until_s``, once."""
        with self._lock:
            self.given_until_s = max(self.given_until_s, until_s)
            due = tuple(notice for notice in self._notices if notice.t_s <= until_s)
            self._notices = [notice for notice in self._notices if notice.t_s > until_s]
            taken: dict[str, Any] = {name: lane.take(until_s) for name, lane in self._lanes.items()}
        return Batch(until_s=until_s, notices=due, **taken)


class TimelineSource:
    """A source that reads a timeline.

    Edges' device stamps are mapped through bounds so far, as by a real driver; ``device_clock`` stamps shocks.
    """

    def __init__(
        self,
        address: str,
        role: str,
        time_base: TimeBase,
        timeline: Timeline,
        describe: Callable[[], SourceInfo],
        map_clock: bool = True,
        device_clock: Callable[[FloatArray], FloatArray] | None = None,
    ) -> None:
        self.address = address
        self.role = role
        self.realtime = time_base.realtime
        self._time = time_base
        self._timeline = timeline
        self._describe = describe
        self._map_clock = map_clock
        self._device_clock = device_clock
        self._clock_map = OnlineClockMap()
        self._until_s = 0.0

    def open(self) -> SourceInfo:
        info = self._describe()
        self._until_s = self._time.now()
        return info

    def read(self, timeout_s: float) -> Batch:
        if self._time.realtime:
            until_s = self._time.wait_past(self._until_s + min(timeout_s, _REAL_READ_S), timeout_s)
        else:
            until_s = min(self._time.wait_past(self._until_s, timeout_s), self._until_s + CHUNK_S)
        self._until_s = max(until_s, self._until_s)
        batch = self._timeline.take(self._until_s)
        if batch.clock is not None:
            self._clock_map.add(batch.clock)
        if self._map_clock and self._clock_map.ready:
            batch = self._mapped(batch)
        return batch

    def close(self) -> None:
        pass

    def _mapped(self, batch: Batch) -> Batch:
        laser, taps = batch.laser, batch.taps
        if laser is not None and len(laser.device_t_s):
            batch = replace(batch, laser=replace(laser, t_s=self._clock_map.to_host(laser.device_t_s)))
        if taps is not None and self._device_clock is not None:
            stamps = self._device_clock(taps.physical_s)
            batch = replace(batch, taps=replace(taps, physical_s=self._clock_map.to_host(stamps)))
        return batch
