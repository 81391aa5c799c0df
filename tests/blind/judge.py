"""One session made, handed over and compared with what was hidden in it."""

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import workflow
from .conditions import UNIDENTIFIABLE, Task, alike, profile_for
from .physics.effects import EFFECTS, LIBRARY
from .physics.session import Truth, make_session
from .visibility import JUST_DETECTABLE, visibility


@dataclass(frozen=True)
class Outcome:
    """The verdict on one session.

    `right` answers the kind's own question: nothing reported (none), the right name first (single, faint), all names
    (pair, triple), owned up to (left_out, unknown). `named` are the library's ids in the order found; `spurious` those
    of them that nothing hidden accounts for. `size`, of the least visible effect, counts just-detectable sizes; None
    where the streams show it.
    """

    kind: str
    row: str
    scale: float
    seed: int
    hidden: dict[str, float]
    right: bool
    named: tuple[str, ...]
    spurious: tuple[str, ...]
    verdict: str
    unexplained_by: str | None
    size: float | None
    parameter_error: float | None
    covered: bool | None
    gap_first_mm: float | None
    gap_last_mm: float | None
    floor_mm: float | None
    seconds: float


def run_task(task: Task) -> Outcome:
    """Make the session (and its twin without the effects), run the workflow on the folder alone, judge."""
    with tempfile.TemporaryDirectory(prefix="draglag-blind-") as name:
        folder, profile = Path(name), profile_for(task.effects)
        effects = dict(task.effects)
        twin = make_session(folder / "twin", task.seed, {}, profile) if effects else None
        truth = make_session(folder / "session", task.seed, effects, profile)
        d = visibility(truth, twin) if twin and len(effects) == 1 else None
        if twin and len(effects) > 1:
            alone = [make_session(folder / key, task.seed, {key: value}, profile) for key, value in effects.items()]
            d = min((seen for one in alone if (seen := visibility(one, twin)) is not None), default=None)
        if task.kind == "faint" and twin and d:
            effects = {key: value * task.scale * JUST_DETECTABLE / d for key, value in effects.items()}
            truth = make_session(folder / "session", task.seed, effects, profile)
            d = visibility(truth, twin)
        report = workflow.close(folder / "session", task.excluded)
        floor = report if twin is None else None
        if twin and task.floor:
            floor = workflow.close(folder / "twin", max_effects=0)
    return judge(task, truth, report, floor, d)


def judge(task: Task, truth: Truth, report: dict[str, Any], floor: dict[str, Any] | None, d: float | None) -> Outcome:
    """Compare a gap report with the truth of its session."""
    hidden, early = truth.effects, truth.rig.taps_before > 0
    steps = [step for step in report["steps"] if step.get("effect") in LIBRARY]
    named = tuple(step["effect"] for step in steps)
    accounted = set().union(*(alike(name, early) for name in hidden)) if hidden else set()
    owned_up = report["verdict"] == "unexplained" or report.get("unexplained_by") is not None
    hits = {name: next((step for step in steps if _is(step, name, early)), None) for name in hidden}
    if task.kind == "none":
        right = not report["steps"] and report["verdict"] == "no_gap"
    elif task.kind in ("single", "faint"):
        (name,) = hidden
        right = bool(steps) and _is(steps[0], name, early)
        right = right or (name in UNIDENTIFIABLE and not steps and not owned_up)
    elif task.kind in ("pair", "triple"):
        right = all(hit is not None for hit in hits.values())
    else:
        right = owned_up and not named
    # A law that follows what moves now has no delay to compare.
    sized = {name: size for name, size in hidden.items() if not truth.variants.get(name, {}).get("present")}
    error, covered = _parameter_error(hits, sized)
    return Outcome(
        task.kind, task.row, task.scale, task.seed, hidden, right, named,
        tuple(name for name in named if name not in accounted),
        report["verdict"], report.get("unexplained_by"), None if d is None else d / JUST_DETECTABLE, error, covered,
        report.get("gap_first_mm"), report.get("gap_last_mm"), floor.get("gap_last_mm") if floor else None,
        report["seconds"],
    )  # fmt: skip


def _is(step: dict[str, Any], name: str, taps_before: bool) -> bool:
    """The step's name is right, or the step says itself that it cannot be told from `name`, and that is so."""
    if step["effect"] == name:
        return True
    return name in step.get("indistinguishable_from", ()) and step["effect"] in alike(name, taps_before)


def _parameter_error(
    hits: dict[str, dict[str, Any] | None], hidden: dict[str, float]
) -> tuple[float | None, bool | None]:
    """Relative error of the first effect found under its own name; whether its interval holds the truth."""
    for name, step in hits.items():
        if name not in hidden or step is None or step["effect"] != name or not step.get("parameters"):
            continue
        key, found = next(iter(step["parameters"].items()))
        unit = _unit(key, EFFECTS[name].unit)
        value = found["value"] * unit
        low, high = sorted(unit * bound for bound in found.get("ci95") or (float("nan"),) * 2)
        return value / hidden[name] - 1, low <= hidden[name] <= high
    return None, None


def _unit(key: str, unit: str) -> float:
    """What turns a parameter called `key` into the generator's unit."""
    if unit.startswith("s") and key.endswith(("_ms", "_ms_per_hour", "_ms_per_h")):
        return 1e-3
    if unit == "1/s" and key.endswith("_per_min"):
        return 1 / 60
    if unit == "s" and key.endswith("_us"):
        return 1e-6
    return 0.01 if unit == "1" and key.endswith("_percent") else 1.0
