"""The source of numbers and figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import draglag
from draglag.recording import Session

SIMULATED = "simulated"  # role in ``Session.devices`` of a session that says so without naming a simulated device

NAMED = 3  # sessions that fit by name into one line below a figure


@dataclass(frozen=True)
class Source:
    """What a figure was drawn from. ``started_utc``: ISO 8601, or empty."""

    session: str
    started_utc: str
    simulated: bool

    def line(self) -> str:
        """The foot of a figure: "SIMULATED · demo · 2026-11-24 10:31 UTC · draglag 1.0"."""
        date = f"{self.started_utc[:16].replace('T', ' ')} UTC" if self.started_utc else "date unknown"
        mark = ["SIMULATED"] if self.simulated else []
        when = [] if self.simulated and not self.started_utc else [date]
        return " · ".join([*mark, self.session, *when, f"draglag {draglag.__version__}"])


def source_of(session: Session) -> Source:
    """The session as the source of a figure."""
    return Source(session.name, session.started_utc, is_simulated(session.devices))


def joint_source(sources: Sequence[Source]) -> Source:
    """Several sessions as one source: simulated if any is, dated if all are of one day."""
    days = {source.started_utc[:10] for source in sources}
    date = sources[0].started_utc if len(days) == 1 else ""
    names = ", ".join(s.session for s in sources) if len(sources) <= NAMED else f"{len(sources)} sessions"
    return Source(names, date, any(s.simulated for s in sources))


def is_simulated(devices: Mapping[str, str]) -> bool:
    """Whether a device (role → address) or the session itself is simulated."""
    return SIMULATED in devices or any(address.startswith("sim:") for address in devices.values())
