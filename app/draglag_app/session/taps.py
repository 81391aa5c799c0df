"""Pairs the WALT's shocks with contacts."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from draglag.instruments.taps import LONGEST_S
from draglag.recording import Taps
from draglag_devices.source import ContactChanges

KIND = {1: "touch", 0: "release"}
# What is reported may be a little newer than the moment up to which all has been reported.
AHEAD_S = 1.0
_T = TypeVar("_T")


@dataclass
class TapPairer:
    """Pairs a touch or release with the last shock before it, each shock once, at most 200 ms apart.

    Rejected: "touch"/"release" without a shock, "shock" without a contact, "clock" (stamped far ahead), and sources'
    own.
    """

    _shocks: list[float] = field(default_factory=list)
    _changes: list[tuple[float, int]] = field(default_factory=list)
    _rejected: Counter[str] = field(default_factory=Counter)

    def add(self, taps: Taps | None = None, changes: ContactChanges | None = None, until_s: float = np.inf) -> None:
        """Add a source's report, complete up to ``until_s``."""
        latest_s = until_s + AHEAD_S
        if taps is not None:
            self._rejected.update(taps.rejected)
            self._shocks = sorted([*self._shocks, *self._known(taps.physical_s <= latest_s, taps.physical_s.tolist())])
        if changes is not None:
            events = list(zip(changes.t_s.tolist(), changes.down.tolist(), strict=True))
            # By time, not by arrival: one stamp of another clock must not hold up those behind it.
            self._changes = sorted([*self._changes, *self._known(changes.t_s <= latest_s, events)])

    def _known(self, good: NDArray[np.bool_], items: list[_T]) -> list[_T]:
        kept = [item for item, well in zip(items, good.tolist(), strict=True) if well]
        if len(kept) < len(items):
            self._rejected["clock"] += len(items) - len(kept)
        return kept

    def take(self, until_s: float) -> Taps:
        """Pairs, once both sources have reported up to ``until_s``."""
        pairs: list[tuple[float, float, int]] = []
        rejected, self._rejected = self._rejected, Counter()
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
