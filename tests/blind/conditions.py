"""What is tried: nothing hidden, effects alone at three sizes, pairs, triples, removed from the library, unknown."""

from dataclasses import dataclass, field

import numpy as np

from .physics.effects import LIBRARY, UNKNOWN, draw_value
from .physics.filters import FILTERS
from .physics.law import FORMS
from .physics.rig import Profile, stream

SCALES = (0.7, 1.0, 2.0)
FAINT = (0.7, 1.5, 3.0)

# Seen in the streams themselves, before any residual.
STREAM = frozenset(
    {"sample_hold", "frame_batching", "timestamp_quantisation", "laser_bounce", "frame_drop", "loss_of_contact"}
)

# Absorbed by Eq. 5 (contact trail is a 1/v term): naming it is welcome, not naming it is no mistake.
UNIDENTIFIABLE = frozenset({"contact_trail"})

# No residual of an edge is left when these are unknown: they thin the stream or move only the taps against the curve.
LEAVES_NO_TRACE = frozenset({"frame_drop", "clock_offset", "contact_trail", "laser_bounce", "timestamp_quantisation"})


def alike(name: str, taps_before: bool) -> frozenset[str]:
    """Names that this kind of session cannot distinguish from `name`, itself among them."""
    classes: list[set[str]] = [{"scale_error", "beam_width"}, {"lagging_law", "acceleration_lag"}]
    if not taps_before:  # only taps at both ends show whose clock it was
        classes.append({"clock_drift", "thermal_drift"})
    return frozenset({name}.union(*(group for group in classes if name in group)))


@dataclass(frozen=True)
class Task:
    """One session to make, hand over and judge."""

    kind: str
    """none, single, faint (scale counts just-detectable sizes, not nominal ones), pair, triple, left_out, unknown, or
    below (an effect too small to matter)."""
    row: str
    scale: float
    seed: int
    effects: dict[str, float] = field(default_factory=dict)
    excluded: tuple[str, ...] = ()
    floor: bool = True
    world: str = "plain"
    law_form: str | None = None


NEEDS_CHANGES_OF_SPEED = frozenset(
    {"lagging_law", "acceleration_lag", "speed_adaptive_filter", "prediction", "alpha_beta_tracker"}
)
SCANS_HZ = 500.0  # of a panel with a filter in its controller


def profile_for(
    effects: dict[str, float] | tuple[str, ...], world: str = "plain", law_form: str | None = None
) -> Profile:
    """Sessions in which the effects can be seen at all; the rest stays drawn."""
    return Profile(
        varied_runs=True if NEEDS_CHANGES_OF_SPEED & set(effects) else None,
        world=world,
        law_form=law_form,
        scan_hz=SCANS_HZ if set(FILTERS) & set(effects) else None,
    )


def sized(names: tuple[str, ...], scale: float, seed: int) -> dict[str, float]:
    """Effects with sizes drawn around scale × nominal."""
    return {name: draw_value(name, scale, stream(seed, f"size {name}")) for name in names}


def _drawn(rng: np.random.Generator, count: int) -> tuple[str, ...]:
    """`count` effects that can all be distinguished from each other."""
    free = [name for name in LIBRARY if name not in UNIDENTIFIABLE]
    while True:
        names = tuple(str(name) for name in rng.choice(free, count, replace=False))
        groups = [alike(name, taps_before=False) for name in names]
        # Two ways of rewriting stamps do not compose into something either could be read off.
        stamps = sum(name in ("sample_hold", "frame_batching", "timestamp_quantisation") for name in names)
        if stamps < 2 and all(groups[i].isdisjoint(groups[j]) for i in range(count) for j in range(i)):
            return names


def tasks(sessions: int, seed: int, only: tuple[str, ...] = (), scales: tuple[float, ...] = SCALES) -> list[Task]:
    """The whole benchmark: `sessions` per row, more of `none`, and of randomly drawn pairs and triples."""
    out: list[Task] = []

    def add(kind: str, row: str, names: tuple[str, ...] | int, scale: float, n: int, less: bool = False) -> None:
        if only and kind not in only and row not in only:
            return
        for k in range(n):
            own = int(stream(seed, f"{kind} {row} {scale} {k}").integers(2**31))
            chosen = _drawn(stream(own, "which"), names) if isinstance(names, int) else names
            gone = tuple(sorted(alike(row, taps_before=False))) if less else ()
            out.append(Task(kind, row, scale, own, sized(chosen, scale, own), gone))

    add("none", "none", (), 1.0, 4 * sessions)
    out += _other_laws(sessions, seed, only)
    for name in LIBRARY:
        faint = () if name in UNIDENTIFIABLE | STREAM else FAINT
        for scale in scales:
            add("single", name, (name,), scale, sessions)
        for scale in faint:
            add("faint", name, (name,), scale, max(1, sessions // 2))
    add("pair", "pairs", 2, 1.0, 4 * sessions)
    add("triple", "triples", 3, 1.0, 2 * sessions)
    for name in (name for name in LIBRARY if name not in LEAVES_NO_TRACE):
        add("left_out", name, (name,), 1.0, sessions, less=True)
    for name in UNKNOWN:
        add("unknown", name, (name,), 1.0, sessions)
    return out


def _other_laws(sessions: int, seed: int, only: tuple[str, ...]) -> list[Task]:
    """Sessions without effects on screens whose law is not Eq. 5, the forms in turn."""
    if only and {"none", "none_other_law"}.isdisjoint(only):
        return []
    seeds = [int(stream(seed, f"none other law {k}").integers(2**31)) for k in range(sessions)]
    others = [form for form in FORMS if form != "double"]
    return [Task("none", "none_other_law", 1.0, own, law_form=others[k % 4]) for k, own in enumerate(seeds)]


def quick_tasks(seed: int) -> list[Task]:
    """About forty sessions of every kind, without the floors' second runs: some minutes on two cores."""
    rng = stream(seed, "quick")
    out = [Task("none", "none", 1.0, int(rng.integers(2**31)), floor=False) for _ in range(10)]
    singles = [name for name in LIBRARY if name not in UNIDENTIFIABLE]
    for name in singles:
        own = int(rng.integers(2**31))
        out.append(Task("single", name, 1.3, own, sized((name,), 1.3, own), floor=False))
    for kind, row, pool in (("unknown", "", UNKNOWN), ("left_out", "", tuple(set(singles) - LEAVES_NO_TRACE - STREAM))):
        for name in rng.permutation(sorted(pool))[:3]:
            own = int(rng.integers(2**31))
            gone = tuple(sorted(alike(str(name), False))) if kind == "left_out" else ()
            out.append(Task(kind, row or str(name), 1.3, own, sized((str(name),), 1.3, own), gone, floor=False))
    for _ in range(3):
        own = int(rng.integers(2**31))
        out.append(Task("pair", "pairs", 1.3, own, sized(_drawn(stream(own, "which"), 2), 1.3, own), floor=False))
    return out
