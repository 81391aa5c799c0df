"""Comparisons of the bus's clock (DC) with the host's."""

from __future__ import annotations

from dataclasses import dataclass

# Frames are at most this stale by honest means; two quartzes stay within 200 ppm of each other.
_TOLERANCE_NS = 300_000
_DRIFT = 2e-4


@dataclass(frozen=True)
class Pair:
    """``dc_ns`` was read between two host times."""

    dc_ns: int
    low_ns: int
    high_ns: int

    @property
    def width_ns(self) -> int:
        return self.high_ns - self.low_ns


class ClockWatch:
    """The known difference of the clocks."""

    def __init__(self) -> None:
        self._reference: Pair | None = None
        self._best: Pair | None = None

    def fits(self, pair: Pair) -> bool:
        """Whether the DC time fits: not of an old frame or a jumped clock."""
        known = self._reference
        if known is None:
            return True
        slack = _TOLERANCE_NS + _DRIFT * abs(pair.low_ns - known.low_ns)
        lowest, highest = known.dc_ns - known.high_ns - slack, known.dc_ns - known.low_ns + slack
        return pair.dc_ns - pair.high_ns <= highest and pair.dc_ns - pair.low_ns >= lowest

    def offset_ns(self, pair: Pair) -> float:
        """Least difference of a device's clock, read in ``pair``, from the bus's."""
        known = self._reference
        if known is None:
            return 0.0
        slack = _DRIFT * abs(pair.low_ns - known.low_ns)
        lowest, highest = known.dc_ns - known.high_ns - slack, known.dc_ns - known.low_ns + slack
        return max(0.0, pair.dc_ns - pair.high_ns - highest, lowest - (pair.dc_ns - pair.low_ns))

    def host_ns(self, dc_ns: int) -> tuple[int, int]:
        """Host times between which the bus's clock showed ``dc_ns``; after ``add``."""
        known = self._reference
        assert known is not None
        slack = int(_DRIFT * abs(dc_ns - known.dc_ns))
        ahead = dc_ns - known.dc_ns
        return known.low_ns + ahead - slack, known.high_ns + ahead + slack

    def add(self, pair: Pair) -> None:
        """Use a pair that ``fits``."""
        if self._best is None or pair.width_ns < self._best.width_ns:
            self._best = pair
        known = self._reference
        # An old reference loses worth as the clocks drift apart.
        if known is None or pair.width_ns < known.width_ns + _DRIFT * (pair.low_ns - known.low_ns):
            self._reference = pair

    def take_best(self) -> Pair | None:
        """The narrowest pair since the last call."""
        best, self._best = self._best, None
        return best
