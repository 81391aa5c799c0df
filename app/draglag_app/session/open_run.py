"""The run being recorded."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from draglag.recording import ClockBounds, DisplayTrace, LaserTrace, LogEntry, Run, TouchTrace, concatenate


@dataclass
class OpenRun:
    """Data saved so far, of samples up to ``to_s``."""

    run: Run
    to_s: float
    touch: list[TouchTrace] = field(default_factory=list)
    laser: list[LaserTrace] = field(default_factory=list)
    display: list[DisplayTrace] = field(default_factory=list)
    sync: dict[str, list[ClockBounds]] = field(default_factory=dict)
    log: list[LogEntry] = field(default_factory=list)

    def assembled(self, outcome: str, duration_s: float) -> Run:
        """The data as one run."""
        empty = self.run
        return replace(
            empty,
            outcome=outcome,
            duration_s=duration_s,
            touch=replace(concatenate(self.touch), axes=empty.touch.axes) if self.touch else empty.touch,
            laser=concatenate(self.laser) if self.laser else empty.laser,
            display=concatenate(self.display) if self.display else empty.display,
            sync=tuple(concatenate(parts) for parts in self.sync.values()),
            log=tuple(self.log),
        )
