"""``draglag import`` and ``draglag export``: the ways in and out of the session file."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from draglag_app.cli.common import load_session, progress, refuse_existing, say_warnings, session_argument

if TYPE_CHECKING:
    from draglag.recording import Session
    from draglag.store import StoredAnalysis


@click.command("import")
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--out", required=True, type=click.Path(path_type=Path), help="The session file to make.")
def import_(folder: Path, out: Path) -> None:
    """Make a session file from FOLDER, in the neutral exchange format: session.json, and for every run
    <id>.touch.csv and <id>.laser.csv (or .csv.gz). Rows that cannot be used are left out and named.

    \b
    Example:
        draglag import measurements/2026-03-01 --out session.h5
    """
    from draglag.exchange import read_exchange
    from draglag.store import write_session

    refuse_existing(out)
    data = read_exchange(folder.parent if folder.name == "session.json" else folder)
    say_warnings(data.notes)
    write_session(data, out)
    edges = sum(len(run.laser.t_s) for run in data.runs)
    events = sum(len(run.touch.t_s) for run in data.runs)
    click.echo(f"{out}: {len(data.runs)} runs, {events} touch events, {edges} edges")


@click.command("export")
@session_argument
@click.option(
    "--to",
    "kind",
    required=True,
    type=click.Choice(["exchange", "csv", "netcdf", "mat"]),
    help="exchange: the neutral folder; csv: one tidy folder; netcdf and mat: one file.",
)
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Folder or file to make.")
def export(session: Path, kind: str, out: Path) -> None:
    """Write SESSION for other programs, and say what the format leaves out. Nothing is overwritten.

    \b
    Examples:
        draglag export session.h5 --to csv --out tables
        draglag export session.h5 --to mat --out session.mat
    """
    from draglag import exchange

    writers: dict[str, Callable[..., Path]] = {
        "exchange": exchange.write_exchange,
        "csv": exchange.write_csv,
        "netcdf": exchange.write_netcdf,
        "mat": exchange.write_mat,
    }
    with _source(session) as (data, results), progress("Writing"):
        writers[kind](data, out, results=results)
        runs, left = len(data.runs), exchange.left_out(data, kind)
    more = f", results of {len(results)} analyses" if results else ""
    click.echo(f"{out}: {runs} runs{more}")
    if left:
        click.echo(f"Left out, and only in {session}: {', '.join(left)}.")


@contextmanager
def _source(path: Path) -> Iterator[tuple[Session, list[StoredAnalysis]]]:
    """A session to export, and its stored results. That of a file stays there until it is written piece by piece."""
    from draglag.store import open_columns, read_analyses

    if path.is_dir() or path.name == "session.json":
        yield load_session(path), []
        return
    results = read_analyses(path)
    with open_columns(path) as data:
        yield data, results
