"""The benchmark from tasks to figures and files; `draglag blind` runs it."""

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from . import workflow
from .conditions import quick_tasks, tasks
from .figure import draw
from .judge import Outcome
from .pool import Unavailable, package_on_path, run_all
from .score import failures, score, table

__all__ = ["Unavailable", "run_benchmark", "table"]


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

    Ctrl+C ends it with the sessions that are done: fewer ("sessions") than asked for ("asked").

    Raises Unavailable when there is no cluster where one is asked for, no workflow to judge, or nothing to do.
    """
    chosen = quick_tasks(seed) if quick else tasks(sessions, seed, only)
    if not chosen:
        raise Unavailable(f"Nothing is called {' or '.join(only)}", "Name a kind (none, single, pair) or an effect")
    why = workflow.missing()
    if why:
        raise Unavailable(f"There is no workflow to judge: {why}", "Install the draglag of this checkout")
    package_on_path()
    outcomes: list[Outcome] = []
    try:
        for outcome in run_all(chosen, jobs, scheduler):
            outcomes.append(outcome)
            if progress:
                progress(len(outcomes), len(chosen))
    except KeyboardInterrupt:
        if not outcomes:
            raise
    outcomes.sort(key=lambda o: (o.kind, o.row, o.scale, o.seed))
    summary = score(outcomes) | {"asked": len(chosen), "seed": seed, "failures": failures(outcomes)}
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        full = summary | {"outcomes": [asdict(o) for o in outcomes]}
        (out / "blind.json").write_text(json.dumps(full, indent=1))
        draw(out / "blind.png", summary, outcomes)
    return summary
