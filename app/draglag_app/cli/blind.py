"""``draglag blind``, in a checkout."""

from __future__ import annotations

import importlib
import os
import sys
from pathlib import Path
from typing import Any

import click

from draglag.errors import DataError
from draglag_app.cli.common import Seed, json_option, print_json, progress


@click.command("blind")
@click.option("--sessions", type=click.IntRange(min=1), default=5, show_default=True, help="Sessions of each row.")
@click.option("--jobs", type=click.IntRange(min=1), metavar="N", help="Processes. Default: one a core.")
@click.option("--scheduler", metavar="ADDRESS", help="Run on a cluster: its Dask scheduler, as tcp://host:8786.")
@click.option("--quick", is_flag=True, help="About forty plain sessions and thirty realistic ones, of every kind.")
@click.option("--only", multiple=True, metavar="NAME", help="A kind (none, single, pair …) or an effect; repeatable.")
@click.option("--seed", type=Seed(), default=1, show_default=True, help="Of everything drawn.")
@click.option("--out", type=click.Path(path_type=Path), metavar="DIR", help="Also write blind.json and figures.")
@click.option(
    "--world",
    type=click.Choice(["plain", "realistic", "both"]),
    default="both",
    show_default=True,
    help="Idealised hands and beams, or real ones.",
)
@click.option(
    "--keep",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="DIR",
    help="Keep the sessions and their truth there, and use those that are there.",
)
@click.option("--engine", metavar="MODULE:FUNCTION", help="Judge this instead: it gets a folder and returns a report.")
@json_option
def blind(
    sessions: int,
    jobs: int | None,
    scheduler: str | None,
    quick: bool,
    only: tuple[str, ...],
    seed: int,
    out: Path | None,
    world: str,
    keep: Path | None,
    engine: str | None,
    as_json: bool,
) -> None:
    """Hide effects in sessions made by independent physics, let `gap` find them, and count: recall, false alarms,
    power against size, parameter error, the last gap over the floor, which effect is taken for which, and whether
    stated probabilities hold. Figures are those of two worlds, apart: one of idealised hands and beams, one of real.

    \b
    Examples:
        draglag blind --quick
        draglag blind --sessions 50 --jobs 8 --out blind
        draglag blind --only low_speed_plateau --only none
        draglag blind --world realistic --sessions 2 --keep sessions
    """
    benchmark = _benchmark()
    if scheduler is None and jobs is None:
        jobs = os.cpu_count() or 1
    with progress("sessions") as on_progress:

        def count(done: int, of: int) -> None:
            if on_progress:
                on_progress(done / of, f"{done} of {of}")

        summary: dict[str, Any] = benchmark.run_benchmark(
            sessions=sessions, jobs=jobs or 1, scheduler=scheduler, quick=quick, seed=seed, only=only, out=out,
            progress=count, world=world, keep=keep, engine=engine,
        )  # fmt: skip
    if as_json:
        print_json(summary)
    else:
        click.echo(benchmark.table(summary))
        for failure in summary["failures"]:
            click.echo(f"Below the promise: {failure}", err=True)
    if summary["sessions"] < summary["asked"]:
        click.echo(f"Stopped: {summary['sessions']} of {summary['asked']} sessions were done.", err=True)
        raise click.exceptions.Exit(1)
    if summary["failures"]:
        raise click.exceptions.Exit(1)


def _benchmark() -> Any:
    places = [Path(__file__).resolve().parents[3], Path.cwd()]
    for place in places:
        if (place / "tests" / "blind" / "benchmark.py").is_file():
            tests = str(place / "tests")
            if tests not in sys.path:
                sys.path.insert(0, tests)
            return importlib.import_module("blind.benchmark")
    raise DataError(
        "The benchmark needs a checkout of draglag; it is not part of the installed program",
        "Run it in a checkout, as ./run draglag blind --quick",
    )
