"""For tests of the EtherCAT laser: a segment, and a record of the source's reports."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from draglag.recording import ClockBounds, LaserTrace, concatenate
from draglag_devices.opening import open_source
from draglag_devices.source import Notice
from emulators.ethercat import Segment, running_segment, why_not

_WHY_NOT = why_not()
needs_segment = [pytest.mark.wire, pytest.mark.skipif(bool(_WHY_NOT), reason=f"no EtherCAT segment here: {_WHY_NOT}")]
MS = 1_000_000
# Long enough for any machine: a test that waits this long has failed.
PATIENCE_S = 30.0


class Recording:
    """An open source that is read until something is true."""

    def __init__(self, segment: Segment, options: str = "?channel=1") -> None:
        self.segment = segment
        self.source: Any = open_source(f"ethercat:{segment.iface}{options}", "laser")
        self.info = self.source.open()
        self.begun_ns = time.monotonic_ns()  # since when cycles are counted on
        self.zero_ns = int(self.info.details["device_zero_ns"])
        self.lasers: list[LaserTrace] = []
        self.clocks: list[ClockBounds] = []
        self.notices: list[Notice] = []
        self.until_s = 0.0
        self.alive = True

    def __enter__(self) -> Recording:
        return self

    def __exit__(self, *_: object) -> None:
        self.source.close()

    def read_until(self, reached: Callable[[], bool], due_s: float = 0.0) -> None:
        """Read batches until the condition holds; fails PATIENCE_S after now, or after when it is due."""
        give_up = max(time.monotonic(), due_s) + PATIENCE_S
        while not reached():
            assert time.monotonic() < give_up, f"never happened; notices so far: {self.texts}"
            batch = self.source.read(0.1)
            if batch.laser is not None:
                self.lasers.append(batch.laser)
            if batch.clock is not None:
                self.clocks.append(batch.clock)
            self.notices.extend(batch.notices)
            self.until_s = max(self.until_s, batch.until_s)
            self.alive = batch.alive

    def read_past(self, t_ns: int) -> None:
        """Read until everything before this host time has been reported by a living source."""
        self.read_until(lambda: self.alive and self.until_s > t_ns * 1e-9, t_ns * 1e-9)

    @property
    def texts(self) -> list[str]:
        return [notice.text for notice in self.notices]

    @property
    def laser(self) -> LaserTrace:
        if self.lasers:
            return concatenate(self.lasers)
        none = np.empty(0)
        return LaserTrace(none, np.empty(0, np.int64), none, np.empty(0, np.int64))

    def stamps_ns(self) -> list[int]:
        """The device's stamps, ns since 2000."""
        return [round(t_s * 1e9) + self.zero_ns for t_s in self.laser.device_t_s]

    def true_edges(self, channel: int = 1) -> list[list[int]]:
        """[host ns, channel, level, stamp ns] of the edges that really happened."""
        edges: list[list[int]] = []
        while part := self.segment.order("log", first=len(edges), count=1000)["edges"]:
            edges += part
        return [edge for edge in edges if edge[1] == channel]


def lost_edges(rec: Recording, true: list[list[int]]) -> tuple[list[list[int]], list[list[int]]]:
    """True edges that were not recorded, and those of them that lie in no marked gap."""
    recorded = set(rec.stamps_ns())
    lost = [edge for edge in true if edge[3] not in recorded]
    dark = rec.laser.gaps_s
    return lost, [e for e in lost if not ((dark[:, 0] <= e[0] * 1e-9) & (e[0] * 1e-9 <= dark[:, 1])).any()]


def judge(rec: Recording, true: list[list[int]], light_is_high: bool = True) -> None:
    """Check that every edge has its stamp, level and time, or lies in a marked gap, and that no more is marked than the
    line stood still: on a machine that kept its cycle, nothing marked, nothing lost."""
    by_stamp = {edge[3]: edge for edge in true}
    recorded = rec.stamps_ns()
    assert len(set(recorded)) == len(recorded)
    for stamp, light, t_s in zip(recorded, rec.laser.light.tolist(), rec.laser.t_s.tolist(), strict=True):
        at_ns, _, level, _ = by_stamp[stamp]
        assert light == (level if light_is_high else 1 - level)
        # 1 ms is what the design warns at; round trips here are ten times shorter.
        assert t_s == pytest.approx(at_ns * 1e-9, abs=1e-3)
    lost, unmarked = lost_edges(rec, true)
    assert unmarked == []
    assert rec.laser.missed <= len(lost)
    assert marked_s(rec) <= stood_still_s(rec)


def marked_s(rec: Recording) -> float:
    """How much time is marked; stretches may overlap."""
    total_s, reached_s = 0.0, -np.inf
    for start_s, end_s in sorted(rec.laser.gaps_s.tolist()):
        total_s += max(0.0, end_s - max(start_s, reached_s))
        reached_s = max(reached_s, end_s)
    return total_s


def stood_still_s(rec: Recording) -> float:
    """How long the segment received no frames with process data, each pause a cycle or two longer; plus a restart where
    the pause required one."""
    log = rec.segment.order("log", since=rec.begun_ns, count=0)
    still_s = log["paused_ns"] * 1e-9
    back = [float(found[1]) for text in rec.texts if (found := re.search(r"back after (\d+\.\d+) s", text))]
    # Eight cycles without an answer take 8 ms each; a bring-up has 70 cycles that are no measurement yet.
    return still_s + 3e-3 * log["pauses"] + (sum(back) + 0.2 * len(back) if still_s > 0.05 else 0.0)


def blink(count: int, period_ns: int, dark_ns: int, first_ns: int, channel: int = 1) -> list[tuple[int, int, int]]:
    """(ns, channel, level): light that comes for ``dark_ns`` every ``period_ns``."""
    return [(first_ns + k * period_ns + (0 if level else dark_ns), channel, level)
            for k in range(count) for level in (1, 0)]  # fmt: skip


def children(process: int) -> list[int]:
    """Process ids of the children of a process."""
    return [int(word) for word in Path(f"/proc/{process}/task/{process}/children").read_text().split()]


def segment_name(prefix: str) -> str:
    """Unique to this process, so that concurrent test runs do not collide."""
    return f"{prefix}{os.getpid() % 100000}"


@pytest.fixture(scope="module")
def wired() -> Iterator[Segment]:
    """One segment for all tests of a file."""
    with running_segment(segment_name("s")) as segment:
        yield segment


@pytest.fixture
def segment(wired: Segment) -> Segment:
    """Healthy and freshly switched on."""
    wired.order("link", up=1)
    wired.order("identity")
    return wired
