"""Edges in the EL1252's process image."""

from __future__ import annotations

import struct
from dataclasses import dataclass

# Inputs, status of the channels, then LatchPos1, LatchNeg1, LatchPos2, LatchNeg2 in ns (fact: 35 bytes).
IMAGE = struct.Struct("<BBBQQQQ")
_INPUT_MASK = 0x03
# The input byte is sampled at another moment of the frame than the latches: it may lag one cycle.
_LEVEL_CYCLES = 3


@dataclass(frozen=True)
class Sample:
    """One channel in one cycle; last edges by the DC clock."""

    level: int
    rise_ns: int
    fall_ns: int


def decode(image: bytes, channel: int) -> Sample:
    """Channel 1 or 2 of an image. Raises struct.error unless 35 bytes."""
    values = IMAGE.unpack(image)
    first = 3 + 2 * (channel - 1)
    return Sample(((values[0] & _INPUT_MASK) >> (channel - 1)) & 1, values[first], values[first + 1])


@dataclass
class EdgeFinder:
    """Edges of one epoch.

    One stamp per direction and cycle: faster edges are lost. Two edges of one direction in a row, or a level unlike the
    last edge, prove one lost edge.
    """

    last: Sample
    level: int = 0
    _disagree: int = 0

    def __post_init__(self) -> None:
        self.level = self.last.level

    def changed(self, sample: Sample) -> list[tuple[int, int]]:
        """(stamp ns, level) of new stamps by time."""
        new = []
        if sample.rise_ns != self.last.rise_ns:
            new.append((sample.rise_ns, 1))
        if sample.fall_ns != self.last.fall_ns:
            new.append((sample.fall_ns, 0))
        return sorted(new)

    def take(self, sample: Sample) -> tuple[list[tuple[int, int]], int]:
        """New edges, and how many are known to be lost."""
        edges = self.changed(sample)
        missed = 0
        for _, level in edges:
            missed += level == self.level
            self.level = level
        self.last = sample
        self._disagree = 0 if sample.level == self.level else self._disagree + 1
        if self._disagree >= _LEVEL_CYCLES:
            missed += 1
            self.level, self._disagree = sample.level, 0
        return edges, missed
