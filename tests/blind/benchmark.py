"""The benchmark from tasks to files: python -m blind.benchmark (tests/ on the path), or `draglag blind`."""

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from . import workflow
from .conditions import quick_tasks, tasks
from .figure import draw
from .judge import Outcome
from .pool import NoScheduler, package_on_path, run_all
from .score import failures, score, table

__all__ = ["NoScheduler", "run_benchmark", "table"]


def run_benchmark(
    sessions: int = 5,
    jobs: int = 2,
    scheduler: str | None = None,
    quick: bool = False,
    seed: int = 1,
    only: tuple[str, ...] = (),
    out: Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """Run the benchmark and return its figures; with `out`, write blind.json and blind.png there.

    Raises NoScheduler when a cluster is asked for and there is none, RuntimeError when there is no workflow to judge.
    """
    why = workflow.missing()
    if why:
        raise RuntimeError(why)
    package_on_path()
    chosen = quick_tasks(seed) if quick else tasks(sessions, seed, only)
    outcomes: list[Outcome] = []
    for outcome in run_all(chosen, jobs, scheduler):
        outcomes.append(outcome)
        if progress:
            progress(len(outcomes), len(chosen))
    outcomes.sort(key=lambda o: (o.kind, o.row, o.scale, o.seed))
    summary = score(outcomes) | {"seed": seed, "failures": failures(outcomes)}
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        full = summary | {"outcomes": [asdict(o) for o in outcomes]}
        (out / "blind.json").write_text(json.dumps(full, indent=1))
        draw(out / "blind.png", summary, outcomes)
    return summary
