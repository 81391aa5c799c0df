"""The truth of a session as plain data, to score any engine's report."""

from dataclasses import asdict, dataclass, field
from typing import Any

from .conditions import STREAM, Task
from .displacement import OF_INTEREST_MM, Displacement
from .physics.effects import ACCEPTED, REAL_LIBRARY
from .physics.real.rig import own_sizes
from .physics.session import Truth


@dataclass(frozen=True)
class Known:
    """The truth that a judgement needs. `size`: of the least visible effect, in just-detectable sizes (plain world) or
    sizes of interest (realistic world); None where the streams show it. `together`: all effects at once. `own`: what
    the rig has of an effect's kind by itself, which no session separates from what is hidden."""

    effects: dict[str, float]
    taps_before: int = 0
    variants: dict[str, Any] = field(default_factory=dict)
    law_form: str = "double"
    size: float | None = None
    displaced: dict[str, Displacement] = field(default_factory=dict)
    together: Displacement | None = None
    own: dict[str, float] = field(default_factory=dict)

    @property
    def accepted(self) -> frozenset[str]:
        """Names of the library that are right for what is in no library."""
        return frozenset().union(*(ACCEPTED.get(name, frozenset()) for name in self.effects))

    @property
    def matters(self) -> bool:
        """Whether anything hidden makes a gap of the size of interest; unknown displacements count as such."""
        return bool(self.effects) and (self.together is None or self.together.matters)


def known_of(
    truth: Truth,
    displaced: dict[str, Displacement] | None = None,
    together: Displacement | None = None,
    size: float | None = None,
) -> Known:
    """What to know of a session that was just made."""
    return Known(
        truth.effects, truth.rig.taps_before, truth.variants, truth.rig.law.form, size, displaced or {}, together,
        own_sizes(truth.rig),
    )  # fmt: skip


def size_of_interest(effects: dict[str, float], together: Displacement | None) -> float | None:
    """The gap in sizes of interest, or None where the streams show what is hidden."""
    if together is None or set(effects) & STREAM:
        return None
    return (together.rms_mm if together.taps_show else together.gap_mm) / OF_INTEREST_MM


def to_json(task: Task, truth: Truth, known: Known) -> dict[str, Any]:
    """The truth of a kept session as plain data."""
    return truth.to_dict() | {
        "task": asdict(task),
        "displacement": {name: asdict(moved) for name, moved in known.displaced.items()},
        "together": None if known.together is None else asdict(known.together),
        "matters": known.matters,
        "size": known.size,
        "own_sizes": known.own,
        "accepted_names": sorted(set(known.effects) & set(REAL_LIBRARY) | known.accepted),
    }


def from_json(data: dict[str, Any]) -> tuple[Task, Known]:
    """The task and what is known, from what `to_json` wrote."""
    task = Task(**(data["task"] | {"excluded": tuple(data["task"]["excluded"])}))
    displaced = {name: Displacement(**moved) for name, moved in data["displacement"].items()}
    together = None if data["together"] is None else Displacement(**data["together"])
    known = Known(
        data["hidden_effects"], data["rig"]["taps_before"], data["variants"], data["law_form"], data["size"],
        displaced, together, data.get("own_sizes", {}),
    )  # fmt: skip
    return task, known
