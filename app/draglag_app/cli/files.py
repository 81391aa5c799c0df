"""``draglag import`` and ``draglag export``."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from draglag.errors import DataError
from draglag.messages import message
from draglag.reading.limits import STYLUS_MM
from draglag_app.cli.common import FiniteRange, load_session, progress, refuse_existing, say_warnings, session_argument

if TYPE_CHECKING:
    from draglag.recording import Session
    from draglag.store import StoredAnalysis


@click.command("import")
@click.argument("paths", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--out", required=True, type=click.Path(path_type=Path), help="The session file to make.")
@click.option(
    "--format",
    "kind",
    type=click.Choice(["exchange", "evtest", "evemu", "libinput", "xdf", "csv"]),
    help="Of the recording. Default: found out.",
)
@click.option(
    "--laser",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="The laser's edges: CSV with t_s,light, or WALT's log. Default: NAME.laser.csv next to NAME.",
)
@click.option(
    "--map",
    "mapped",
    multiple=True,
    metavar="KEY=COLUMN[:UNIT]",
    help="Columns, units and clocks: t, x, y, contact, device_t, laser.t, laser.light; clock=SECONDS; may be repeated.",
)
@click.option("--screen", metavar="NAME", help="Preset or TOML file of the screen.")
@click.option("--units-per-mm", type=FiniteRange(min=0, min_open=True), metavar="N", help="Of the touchscreen.")
@click.option("--stylus-mm", type=FiniteRange(*STYLUS_MM, min_open=True), metavar="MM", help="Diameter of the stylus.")
@click.option(
    "--protocol",
    type=click.Choice(["circle", "chirp", "multisine", "step", "free"]),
    default="free",
    show_default=True,
    help="What was drawn.",
)
def import_(
    paths: tuple[Path, ...],
    out: Path,
    kind: str | None,
    laser: Path | None,
    mapped: tuple[str, ...],
    screen: str | None,
    units_per_mm: float | None,
    stylus_mm: float | None,
    protocol: str,
) -> None:
    """Make a session file from a folder in the neutral exchange format (session.json, and for every run
    <id>.touch.csv and <id>.laser.csv), or from recordings of evtest, evemu, libinput record, the Lab Streaming Layer
    (XDF) or any CSV file, one run each. What cannot be used is left out and named.

    \b
    Examples:
        draglag import measurements/2026-03-01 --out session.h5
        draglag import WALT_2026_evtest.log --screen screen-1 --protocol circle --out session.h5
        draglag import drag.csv --map t=stamp:ms --map x=posX:px --map y=posY:px \\
            --laser diode.csv --map laser.light=volt:>1.5 --screen screen-1 --out session.h5
    """
    from draglag.exchange.importers import HowToRead, parse_map, read_recordings
    from draglag.protocol.presets import load_screen
    from draglag.store import write_session

    refuse_existing(out)
    for path in paths:
        if not path.exists():
            raise DataError(message("{path}: there is no such folder or file", path=path), "Check the path")
    first = paths[0]
    if kind == "exchange" or (kind is None and (first.is_dir() or first.name == "session.json")):
        data = _exchange(paths, laser, mapped)
    else:
        panel = None if screen is None else load_screen(screen)
        how = HowToRead(kind, laser, parse_map(mapped), panel, units_per_mm, stylus_mm, protocol)
        data = read_recordings(paths, how)
    say_warnings(data.notes)
    write_session(data, out)
    edges = sum(len(run.laser.t_s) for run in data.runs)
    events = sum(len(run.touch.t_s) for run in data.runs)
    click.echo(f"{out}: {len(data.runs)} runs, {events} touch events, {edges} edges")


def _exchange(paths: tuple[Path, ...], laser: Path | None, mapped: tuple[str, ...]) -> Session:
    from draglag.exchange import read_exchange

    if len(paths) > 1 or laser is not None or mapped:
        raise click.UsageError("An exchange folder is imported alone, without --laser and --map.")
    return read_exchange(paths[0].parent if paths[0].name == "session.json" else paths[0])


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
    from draglag.store import open_columns, read_analyses

    if path.is_dir() or path.name == "session.json":
        yield load_session(path), []
        return
    results = read_analyses(path)
    with open_columns(path) as data:
        yield data, results
