"""Notices of disturbed bus cycles."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from draglag.messages import Message, joined, message
from draglag_devices.source import Notice

# A lost cycle costs no edge, for the latches keep the last of each direction. Where one in a hundred goes, two edges
# in a pause become likely: that is worth the operator's attention.
MATTERS = 0.01
WARN_EVERY_S, COUNT_EVERY_S = 10.0, 60.0
# A summary of a moment (at the end) is no rate.
_A_SECOND = 1000


class Disturbances:
    """Counts of refused cycles; ``total`` by reason."""

    def __init__(self) -> None:
        self.total: Counter[str] = Counter()
        self._counts: Counter[str] = Counter()
        self._cycles = 0
        self._matter = False
        self._since_s: float | None = None
        self._warned_s = -WARN_EVERY_S

    def take(self, from_s: float, t_s: float, cycles: int, counts: Mapping[str, int]) -> Notice | None:
        """A notice on unreported cycles, if due."""
        if self._since_s is None:
            self._since_s = from_s
        self.total += Counter(counts)
        self._counts += Counter(counts)
        self._cycles += cycles
        self._matter |= sum(counts.values()) >= MATTERS * max(cycles, _A_SECOND)
        if self._matter and t_s - self._warned_s >= WARN_EVERY_S:
            self._warned_s = t_s
            return self.rest(t_s)
        return self.rest(t_s) if t_s - self._since_s >= COUNT_EVERY_S else None

    def rest(self, t_s: float) -> Notice | None:
        """A notice on unreported cycles."""
        counts, self._counts = self._counts, Counter()
        cycles, self._cycles = self._cycles, 0
        since_s, self._since_s = self._since_s, None
        matter, self._matter = self._matter, False
        if not counts or since_s is None:
            return None
        percent = 100 * counts.total() / max(cycles, counts.total())
        text = message(
            "{percent:.2g} % of the EtherCAT cycles of the last {seconds:.0f} s were disturbed: {parts}. Where edges "
            "may be missing is marked.",
            percent=percent,
            seconds=max(t_s - since_s, 1),
            parts=joined(", ", (_counted(reason, n) for reason, n in sorted(counts.items()))),
        )
        if matter:
            remedy = message("Close other programs, check the cable and the supply of the coupler.")
            text = joined(" ", (text, remedy))
        return Notice(t_s, "warning" if matter else "info", text)


def _counted(reason: str, n: int) -> Message:
    return {
        "lost": message("{n} without an answer", n=n),
        "counter": message("{n} without the EL1252", n=n),
        "stale": message("{n} with old data", n=n),
        "stamp": message("{n} with impossible stamps", n=n),
    }[reason]
