"""Commands on many sessions."""

from __future__ import annotations

import csv
import glob
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from draglag.errors import DataError
from draglag.messages import message
from draglag.system.packages import need
from draglag_app.cli.batch import Outcome
from draglag_app.cli.common import number, print_json, progress, refuse_existing, table, written_whole
from draglag_app.parallel import spread

Function = Callable[..., Any]


def work_options(command: Function) -> Function:
    """Add --jobs and --scheduler."""
    for option in (
        click.option("--scheduler", metavar="ADDRESS", help="Work on a Dask cluster: its scheduler, as tcp://host:8786."),
        click.option("--jobs", type=click.IntRange(min=1), metavar="N", help="Processes. Default: one a core."),
    ):  # fmt: skip
        command = option(command)
    return command


def many_options(command: Function) -> Function:
    """Add the options of a command for one session or many."""
    command = work_options(command)
    for option in (
        click.option("--summary", "summary_path", type=click.Path(path_type=Path), metavar="FILE.html",
                     help="Of many sessions: write a page with a row and a small picture each."),
        click.option("--out", type=click.Path(path_type=Path), metavar="TABLE.csv|.parquet",
                     help="Of many sessions: write the table, a row each."),
    ):  # fmt: skip
        command = option(command)
    return command


def sessions_in(paths: Sequence[Path]) -> list[Path]:
    """Session files and exchange folders, each once. Raises DataError where a path has none.

    In folders: exchange folders, session files down to one level below.
    """
    found: dict[Path, None] = {}
    for path in paths:
        some = _in_one(path)
        if not some:
            raise DataError(
                message("{path}: holds no session", path=path),
                "Name session files (.h5), exchange folders, or folders of them",
            )
        found |= dict.fromkeys(some)
    return list(found)


def is_one(paths: Sequence[Path]) -> bool:
    """Whether the paths name one session."""
    if len(paths) != 1:
        return False
    path = paths[0]
    return not (_is_glob(path) or (path.is_dir() and not (path / "session.json").is_file() and _in_one(path)))


def only_one(asked: Mapping[str, object]) -> None:
    """Raise click.UsageError for options that need a single session."""
    for name, value in asked.items():
        if value:
            raise click.UsageError(f"{name} works on one session, and several are named.")


def only_many(asked: Mapping[str, object]) -> None:
    """Raise click.UsageError for options that need several sessions."""
    for name, value in asked.items():
        if value is not None:
            raise click.UsageError(f"{name} is of many sessions; name several, a folder of them or a glob.")


def _is_glob(path: Path) -> bool:
    return glob.has_magic(str(path)) and not path.exists()


def _in_one(path: Path) -> list[Path]:
    if _is_glob(path):
        return [one for name in sorted(glob.glob(str(path), recursive=True)) for one in _in_one(Path(name))]
    if not path.is_dir() or (path / "session.json").is_file():
        return [path]
    # Two levels, not any depth: a slip such as / must not search a whole disk. Globs (**) go deeper where asked to.
    files = [one for level in ("*.h5", "*/*.h5") for one in path.glob(level) if one.is_file()]
    return sorted([*files, *(one.parent for one in path.glob("*/session.json"))])


def run_many(
    work: Callable[[Path], Outcome],
    paths: Sequence[Path],
    label: str,
    jobs: int | None,
    scheduler: str | None,
) -> list[Outcome]:
    """Every path's outcome, in their order."""
    done: dict[int, Outcome] = {}
    with progress(label) as report:
        for place, outcome in spread(work, paths, jobs, scheduler):
            done[place] = outcome
            if report:
                report(len(done) / len(paths), f"{len(done)} of {len(paths)}")
    return [done[place] for place in sorted(done)]


def refuse_outputs(out: Path | None, *others: Path | None) -> None:
    """Raise, before long work, for outputs that cannot be written."""
    for path in filter(None, (out, *others)):
        refuse_existing(path)
    if out is not None and out.suffix not in (".csv", ".parquet"):
        raise click.UsageError("--out takes a name that ends on .csv or .parquet.")
    if out is not None and out.suffix == ".parquet":
        need("pandas", "pyarrow")


def write_table(rows: Sequence[dict[str, Any]], columns: Sequence[str], path: Path) -> None:
    """Write CSV or Parquet. Raises DataError."""
    with written_whole(path) as growing:
        if path.suffix == ".parquet":
            from draglag.analysis.tables import frame_of

            frame_of(list(rows), list(columns)).to_parquet(growing)
            return
        with growing.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, columns, restval="", extrasaction="ignore")
            writer.writeheader()
            writer.writerows({key: "" if value is None else value for key, value in row.items()} for row in rows)


def conclude(
    outcomes: Sequence[Outcome], columns: Sequence[str], shown: Sequence[tuple[str, str, int]], *, legend: str,
    title: str, out: Path | None, summary: Path | None, as_json: bool,
) -> None:  # fmt: skip
    """Print the results, write table and page, name failures; exit 1 if any.

    ``shown``: columns for people, with head and digits (−1: no number).
    """
    head = [name for _, name, _ in shown]
    cells = [[_cell(outcome.row, key, digits) for key, _, digits in shown] for outcome in outcomes]
    if out is not None:
        write_table([outcome.row for outcome in outcomes], columns, out)
    if summary is not None:
        from draglag_app.cli.summary_page import page

        with written_whole(summary) as growing:
            growing.write_text(page(title, head, list(zip(outcomes, cells, strict=True)), legend), "utf-8")
    failed = [outcome for outcome in outcomes if outcome.problem]
    if as_json:
        sessions = [{"file": o.file, "problem": o.problem or None, "result": o.result or None} for o in outcomes]
        print_json({"sessions": sessions, "n_failed": len(failed)})
    else:
        _print_table(head, [row for outcome, row in zip(outcomes, cells, strict=True) if not outcome.problem])
        _print_written(out, summary)
    end_with([_with_file(outcome) for outcome in failed], len(outcomes))


def _print_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    if rows:
        click.echo(table(head, rows))


def _print_written(*paths: Path | None) -> None:
    written = [str(path) for path in paths if path is not None]
    if written:
        click.echo(f"\nWritten: {', '.join(written)}")


def end_with(problems: Sequence[str], n_sessions: int) -> None:
    """Name failures on stderr; exit 1 if any."""
    for problem in problems:
        click.echo(f"failed: {problem}", err=True)
    if problems:
        click.echo(f"draglag: {len(problems)} of {n_sessions} sessions failed; see the lines above.", err=True)
        raise click.exceptions.Exit(1)


def _with_file(outcome: Outcome) -> str:
    return outcome.problem if outcome.file in outcome.problem else f"{outcome.file}: {outcome.problem}"


def _cell(row: Mapping[str, Any], key: str, digits: int) -> str:
    value = row.get(key)
    if digits >= 0 or value is None:
        return number(value, max(digits, 0))
    return f"{value} (simulated)" if key == "screen" and row.get("simulated") else str(value)
