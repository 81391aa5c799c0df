"""One epoch of the bus: which cycles count, which edges they carry, and when it is time to start over."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from draglag_devices.ethercat_laser.bus import Cycle
from draglag_devices.ethercat_laser.clockwatch import ClockWatch
from draglag_devices.ethercat_laser.edges import EdgeFinder, decode

BAD_CYCLES = 8
# Stamps come from the terminal's clock, DC times from the coupler's; both follow one time to within microseconds.
_STAMP_TOLERANCE_NS = 5_000_000

WORDS = {
    "lost": "the EtherCAT line does not answer (cable or supply)",
    "counter": "the EL1252 does not answer (unplugged, without supply or reset)",
    "stale": "answers come late and carry old data",
    "stamp": "the EL1252's stamps do not fit the bus's clock (it was reset)",
}


@dataclass
class Epoch:
    """Supervision of the cycles since the last bring-up.

    Attributes:
        number: counts bring-ups.
        bad: consecutive cycles that were refused, ``counts`` all of them by reason.
        good_ns: host time up to which all edges have been read, or None before the first accepted cycle.
        good_dc_ns: DC time of the last accepted cycle.
    """

    number: int
    channel: int
    expected_wkc: int
    clock: ClockWatch = field(default_factory=ClockWatch)
    counts: Counter[str] = field(default_factory=Counter)
    bad: int = 0
    why: str = ""
    good_ns: int | None = None
    edges: EdgeFinder | None = None
    good_dc_ns: int = 0

    def take(self, cycle: Cycle) -> tuple[list[tuple[int, int]], int] | None:
        """Edges (stamp ns, level) and lost edges of an accepted cycle; None if it is refused."""
        reason = self._fault(cycle)
        if reason:
            self.bad += 1
            self.why = reason
            self.counts[reason] += 1
            return None
        sample = decode(cycle.image, self.channel)
        if self.edges is None:
            self.edges = EdgeFinder(sample)
            found: tuple[list[tuple[int, int]], int] = ([], 0)
        else:
            found = self.edges.take(sample)
        self.bad = 0
        self.clock.add(cycle.pair)
        self.good_ns, self.good_dc_ns = cycle.pair.low_ns, cycle.pair.dc_ns
        return found

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
