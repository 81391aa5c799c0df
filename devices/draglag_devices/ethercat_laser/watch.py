"""Validity of cycles."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from draglag.messages import message
from draglag_devices.ethercat_laser.bus import Cycle
from draglag_devices.ethercat_laser.clockwatch import ClockWatch, Pair
from draglag_devices.ethercat_laser.edges import EdgeFinder, decode
from draglag_devices.ethercat_laser.waits import STALL_NS, UNWATCHED_NS

BAD_CYCLES = 8
# Stamps come from the terminal's clock, DC times from the coupler's; both follow one time to within microseconds.
_STAMP_TOLERANCE_NS = 5_000_000

WORDS = {
    "lost": message("the EtherCAT line does not answer (cable or supply)"),
    "counter": message("the EL1252 does not answer (unplugged, without supply or reset)"),
    "stale": message("answers come late and carry old data"),
    "stamp": message("the EL1252's stamps do not fit the bus's clock (it was reset)"),
}


@dataclass(frozen=True)
class Found:
    """Result of an accepted cycle.

    Attributes:
        edges: (stamp ns, level) by time.
        missed: further edges known to be lost.
        unverified_ns: host times in which edges may be lost without a sign.
    """

    edges: list[tuple[int, int]]
    missed: int = 0
    unverified_ns: tuple[int, int] | None = None


@dataclass
class Epoch:
    """Supervision of cycles since a set-up.

    Attributes:
        bad: consecutive refused cycles; ``counts``: all by reason.
        last: clocks of the last accepted cycle.
        pauses_ns: between accepted cycles; the reader empties it, and resets ``cycles``.
    """

    number: int
    channel: int
    expected_wkc: int
    clock: ClockWatch = field(default_factory=ClockWatch)
    counts: Counter[str] = field(default_factory=Counter)
    bad: int = 0
    edges: EdgeFinder | None = None
    last: Pair | None = None
    pauses_ns: list[int] = field(default_factory=list)
    cycles: int = 0
    _lately: Counter[str] = field(default_factory=Counter)

    @property
    def why(self) -> str:
        """Why cycles are refused now; "lost" last, as busy computers lose answers."""
        others = Counter({reason: n for reason, n in self._lately.items() if reason != "lost"})
        return max(others or self._lately, key=self._lately.__getitem__, default="")

    @property
    def good_ns(self) -> int | None:
        """Host time up to which all edges have been read."""
        return None if self.last is None else self.last.low_ns

    @property
    def good_dc_ns(self) -> int:
        """The bus's clock at the last accepted cycle."""
        return 0 if self.last is None else self.last.dc_ns

    def take(self, cycle: Cycle) -> Found | None:
        """Edges of an accepted cycle; None if refused."""
        reason = self._fault(cycle)
        self.cycles += 1
        if reason:
            self.bad += 1
            self.counts[reason] += 1
            self._lately[reason] += 1
            return None
        sample = decode(cycle.image, self.channel)
        if self.edges is None or self.last is None:
            self.edges = EdgeFinder(sample)
            found = Found([])
        else:
            edges, missed = self.edges.take(sample)
            found = Found(edges, missed, self._unverified(self.last, cycle.pair, edges))
            pause_ns = cycle.pair.dc_ns - self.last.dc_ns
            if pause_ns > STALL_NS:
                self.pauses_ns.append(pause_ns)
        self.bad = 0
        self._lately.clear()
        self.clock.add(cycle.pair)
        self.last = cycle.pair
        return found

    def _unverified(self, last: Pair, now: Pair, edges: list[tuple[int, int]]) -> tuple[int, int] | None:
        """Host times between two cycles in which edges may have been overwritten.

        A latch keeps the last edge of its direction. If at most one has a new stamp, it was the only edge: another
        would need one of the other direction between. Else any number of pairs may be missing before the earlier stamp,
        none after it.
        """
        start_ns = max(last.low_ns, self.clock.host_ns(last.dc_ns)[0])
        if now.dc_ns - last.dc_ns > UNWATCHED_NS:
            return start_ns, min(now.high_ns, self.clock.host_ns(now.dc_ns)[1])
        if len(edges) < 2 or now.dc_ns - last.dc_ns <= STALL_NS:
            return None
        # The stamp is the terminal's, and by its drift from the bus's clock (reported above 1 ms) it may be ahead.
        end_ns = min(now.high_ns, self.clock.host_ns(edges[0][0])[1])
        return start_ns, max(start_ns, end_ns)

    def _fault(self, cycle: Cycle) -> str:
        if cycle.wkc < 0:
            return "lost"
        if cycle.wkc != self.expected_wkc:
            return "counter"
        if not self.clock.fits(cycle.pair) or cycle.pair.dc_ns <= self.good_dc_ns:
            return "stale"
        if self.edges is not None:
            lowest = self.good_dc_ns - _STAMP_TOLERANCE_NS
            highest = cycle.pair.dc_ns + _STAMP_TOLERANCE_NS
            new = self.edges.changed(decode(cycle.image, self.channel))
            if any(not lowest <= stamp <= highest for stamp, _ in new):
                return "stamp"
        return ""
