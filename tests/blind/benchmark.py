"""The benchmark from tasks to figures and files; `draglag blind` runs it."""

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from draglag.errors import DataError

from . import workflow
from .conditions import Task, quick_tasks, tasks
from .figure import draw, draw_reliability
from .judge import Outcome
from .places import run_all
from .realistic import quick_real_tasks, real_tasks
from .score import WORLDS, score_worlds, table

__all__ = ["run_benchmark", "table"]


def run_benchmark(
    sessions: int = 5,
    jobs: int = 2,
    scheduler: str | None = None,
    quick: bool = False,
    seed: int = 1,
    only: tuple[str, ...] = (),
    out: Path | None = None,
    progress: Callable[[int, int], None] | None = None,
    world: str = "both",
    keep: Path | None = None,
    engine: str | None = None,
) -> dict[str, Any]:
    """The figures of the benchmark; with `out`, also blind.json, a figure per world and reliability.png there.

    world: plain, realistic or both. keep: folder for sessions and truth, which are used again. engine:
    "module:function" that takes a folder and returns a gap report, instead of this checkout's. Ctrl+C ends with the
    sessions done: fewer ("sessions") than requested ("asked").

    Raises DraglagError: no cluster where one is requested, no workflow to judge, or nothing to do.
    """
    chosen = choose(world, sessions, quick, seed, only)
    if not chosen:
        raise DataError(f"Nothing is called {' or '.join(only)}", "Name a kind (none, single, pair) or an effect")
    why = None if engine else workflow.missing()
    if why:
        raise DataError(f"There is no workflow to judge: {why}", "Install the draglag of this checkout")
    outcomes: list[Outcome] = []
    try:
        for outcome in run_all(chosen, jobs, scheduler, keep and keep.resolve(), engine):
            outcomes.append(outcome)
            if progress:
                progress(len(outcomes), len(chosen))
    except KeyboardInterrupt:
        if not outcomes:
            raise
    outcomes.sort(key=lambda o: (o.world, o.kind, o.row, o.scale, o.seed))
    summary = score_worlds(outcomes) | {"asked": len(chosen), "seed": seed}
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        full = summary | {"outcomes": [asdict(o) for o in outcomes]}
        (out / "blind.json").write_text(json.dumps(full, indent=1))
        for name, found in summary["worlds"].items():
            draw(out / f"blind-{name}.png", found, [o for o in outcomes if o.world == name])
        draw_reliability(out / "reliability.png", summary["worlds"])
    return summary


def choose(world: str, sessions: int, quick: bool, seed: int, only: tuple[str, ...]) -> list[Task]:
    """Tasks of the worlds asked for."""
    out: list[Task] = []
    for name in WORLDS if world == "both" else (world,):
        if name == "plain":
            out += quick_tasks(seed) if quick else tasks(sessions, seed, only)
        else:
            out += quick_real_tasks(seed) if quick else real_tasks(sessions, seed, only)
    return out
