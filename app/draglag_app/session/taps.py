"""Pairing what the WALT felt with what the kernel registered."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from draglag.recording import Taps
from draglag.taps import LONGEST_S
from draglag_devices.source import ContactChanges

KIND = {1: "touch", 0: "release"}


@dataclass
class TapPairer:
    """Every registered touch or release takes the last shock before it, each shock once, at most 200 ms apart.

    What finds no partner is counted: "touch"/"release" for an event without a shock, "shock" for the other way.
    """

    _shocks: list[float] = field(default_factory=list)
    _changes: list[tuple[float, int]] = field(default_factory=list)

    def add(self, taps: Taps | None = None, changes: ContactChanges | None = None) -> None:
        """Take what a source reported; each kind in order of time."""
        if taps is not None:
            self._shocks.extend(taps.physical_s.tolist())
        if changes is not None:
            self._changes.extend(zip(changes.t_s.tolist(), changes.down.tolist(), strict=True))

    def take(self, until_s: float) -> Taps:
        """Pairs that are certain once both sources have reported all before ``until_s``."""
        pairs: list[tuple[float, float, int]] = []
        rejected: Counter[str] = Counter()
        while self._changes and self._changes[0][0] <= until_s:
            seen_s, down = self._changes.pop(0)
            before = [shock for shock in self._shocks if shock <= seen_s]
            self._shocks = self._shocks[len(before) :]
            if before and seen_s - before[-1] <= LONGEST_S:
                pairs.append((before.pop(), seen_s, down))
            else:
                rejected[KIND[down]] += 1
            rejected["shock"] += len(before)
        stale = [shock for shock in self._shocks if shock < until_s - LONGEST_S]
        self._shocks = self._shocks[len(stale) :]
        rejected["shock"] += len(stale)
        table = np.array(pairs).reshape(-1, 3)
        reasons = {reason: count for reason, count in rejected.items() if count}
        return Taps(table[:, 0], table[:, 1], table[:, 2].astype(np.int64), reasons)
