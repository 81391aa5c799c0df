"""One session made, handed over and compared with what was hidden in it."""

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import workflow
from .conditions import UNIDENTIFIABLE, Task, alike
from .known import Known
from .making import kept_or_made, make_twin
from .physics.effects import EFFECTS, REAL_LIBRARY


@dataclass(frozen=True)
class Outcome:
    """The verdict on one session.

    `right`: nothing reported (none), the right name first (single, faint), that or nothing (below), all names (pair,
    triple), `unexplained` or an equivalent name (left_out, unknown). `answer`: right name, wrong name, unexplained,
    quiet or refused; `fair`: whether it is a good one, including quiet where nothing hidden makes a gap of interest.
    `probability`: stated for the first name, if any. `named`: the library's ids in the order found; `spurious`: those
    that nothing hidden accounts for. `size`: of the least visible effect, in just-detectable sizes, in the realistic
    world in sizes of interest; None where the streams show it.
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
    world: str = "plain"
    law_form: str = "double"
    answer: str = ""
    fair: bool = False
    probability: float | None = None
    displaced_mm: float | None = None
    left_mm: float | None = None


def run_task(task: Task, keep: Path | None = None, engine: str | None = None) -> Outcome:
    """Make the session (or find it in `keep`), run the workflow or `engine` on the folder alone, judge."""
    with tempfile.TemporaryDirectory(prefix="draglag-blind-") as name:
        scratch = Path(name)
        made = kept_or_made(task, scratch, keep)
        report = workflow.close(made.folder, task.excluded, engine=engine)
        floor = None if made.known.effects else report
        if made.known.effects and task.floor and engine is None:
            make_twin(task, made, scratch / "twin")
            floor = workflow.close(scratch / "twin", max_effects=0)
    return judge(task, made.known, report, floor)


def judge(task: Task, known: Known, report: dict[str, Any], floor: dict[str, Any] | None = None) -> Outcome:
    """Compare a gap report (the JSON of `draglag gap`) with what is known of its session."""
    hidden, early = known.effects, known.taps_before > 0
    steps = [step for step in report.get("steps", ()) if step.get("effect") in REAL_LIBRARY]
    named = tuple(step["effect"] for step in steps)
    accounted = known.accepted.union(*(alike(name, early) for name in hidden))
    owned_up = report["verdict"] == "unexplained" or report.get("unexplained_by") is not None
    hits = {name: next((step for step in steps if _is(step, name, early)), None) for name in hidden}
    answer = _answer(known, report, steps, owned_up)
    right = _right(task.kind, known, report, answer, hits)
    # A law that follows what moves now has no delay to compare.
    whole = {name: size + known.own.get(name, 0.0) for name, size in hidden.items()}
    sized = {name: size for name, size in whole.items() if not known.variants.get(name, {}).get("present")}
    error, covered = _parameter_error(hits, sized)
    stated = steps[0].get("probability") if steps else None
    return Outcome(
        task.kind, task.row, task.scale, task.seed, hidden, right, named,
        tuple(name for name in named if name not in accounted),
        str(report["verdict"]), report.get("unexplained_by"), known.size, error, covered,
        report.get("gap_first_mm"), report.get("gap_last_mm"), floor.get("gap_last_mm") if floor else None,
        report.get("seconds", 0.0), task.world, known.law_form, answer,
        right or (answer == "quiet" and not known.matters), None if stated is None else float(stated),
        known.together.rms_mm if known.together else None, known.together.gap_mm if known.together else None,
    )  # fmt: skip


def _answer(known: Known, report: dict[str, Any], steps: list[dict[str, Any]], owned_up: bool) -> str:
    """What was said: a name goes before `unexplained`, which may stand with it."""
    if steps:
        first, early = steps[0], known.taps_before > 0
        right = first["effect"] in known.accepted or any(_is(first, name, early) for name in known.effects)
        return "right name" if right else "wrong name"
    if owned_up:
        return "unexplained"
    return "quiet" if report["verdict"] == "no_gap" else "refused"


def _right(
    kind: str, known: Known, report: dict[str, Any], answer: str, hits: dict[str, dict[str, Any] | None]
) -> bool:
    """Whether the kind's own question is answered."""
    if kind == "none":
        return not report.get("steps") and report["verdict"] == "no_gap"
    if kind in ("single", "faint", "below"):
        may_be_quiet = kind == "below" or not UNIDENTIFIABLE.isdisjoint(known.effects)
        return answer == "right name" or (may_be_quiet and answer == "quiet")
    if kind in ("pair", "triple"):
        return all(hit is not None for hit in hits.values())
    return answer == "unexplained" or (kind == "unknown" and answer == "right name")


def _is(step: dict[str, Any], name: str, taps_before: bool) -> bool:
    """Whether the step's name is right, or the step truly says that it is indistinguishable from `name`."""
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
