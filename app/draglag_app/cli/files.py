"""``draglag import`` and ``draglag export``: the ways in and out of the session file."""

from __future__ import annotations

from pathlib import Path

import click

from draglag_app.cli.common import load_session, progress, refuse_existing, say_warnings, session_argument


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

    writers = {
        "exchange": exchange.write_exchange,
        "csv": exchange.write_csv,
        "netcdf": exchange.write_netcdf,
        "mat": exchange.write_mat,
    }
    data = load_session(session)
    with progress("Writing"):
        writers[kind](data, out)
    click.echo(f"{out}: {len(data.runs)} runs")
    click.echo(f"Left out, and only in {session}: {', '.join(exchange.left_out(data, kind))}.")
