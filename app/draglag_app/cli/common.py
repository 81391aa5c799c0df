"""Shared by commands."""

from __future__ import annotations

import hashlib
import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from draglag.errors import DataError, cause, one_line
from draglag.messages import message
from draglag.reading.limits import WHOLE_MOST
from draglag.recording import LogEntry, Session

if TYPE_CHECKING:
    from draglag.store import FileState

Progress = Callable[[float, str], None]
# A name has 255 bytes on Linux's file systems; what grows under it for a while has a longer one (store, temporary).
NAME_BYTES = 200


class Seed(click.IntRange):
    """A seed of at most 128 bits."""

    def __init__(self) -> None:
        super().__init__(min=0, max=WHOLE_MOST)


class FiniteRange(click.FloatRange):
    """A range that also refuses inf and nan."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} is not a number to work with.", param, ctx)
        return number


session_argument = click.argument("session", type=click.Path(path_type=Path))
json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else.")


def load_session(path: Path) -> Session:
    """A session file or exchange folder. Raises DataError."""
    return load_with_state(path)[0]


def load_with_state(path: Path, analysed: bool = False) -> tuple[Session, FileState | None]:
    """As ``load_session``, and the state of a session file when it was read.

    ``analysed``: leaves the warnings that an analysis gives, too, to that.
    """
    if path.is_dir() or path.name == "session.json":
        from draglag.exchange import read_exchange, session_folder
        from draglag.reading.off_screen import off_screen

        session = read_exchange(session_folder(path))
        again = off_screen(session.screen, session.runs) if analysed else []
        say_warnings(note for note in session.notes if note.text not in again)
        return session, None
    from draglag.store import read_with_state

    return read_with_state(path)


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """Yields a temporary path; the file gets its name when the block ends. Raises DataError."""
    from draglag.system.temporary import new_file

    try:
        with new_file(path) as growing:
            yield growing
    except OSError as error:
        raise DataError(
            message("{path}: cannot be written ({why})", path=path, why=cause(error)), "Check the folder and free space"
        ) from error


def refuse_unknown_runs(path: Path, session: Session, ids: Iterable[str]) -> None:
    """Raise DataError for an unknown run id; ``all`` is known."""
    unknown = sorted(set(ids) - {run.id for run in session.runs} - {"all"})
    if unknown:
        raise DataError(
            message("{path}: there is no run {name}", path=path, name=repr(unknown[0])),
            "See draglag analyze for the ids",
        )


def keep_result(
    path: Path, analysed: FileState | None, result: Mapping[str, Any], options: Mapping[str, Any], must: bool
) -> None:
    """Store a result in its session file; failure is a warning, or a DataError if ``must``.

    analysed: state of the file when it was read. Without ``must``, exchange folders and journals, which keep none, are
    no failure.
    """
    from draglag.store import add_analysis
    from draglag.store.journal import is_journal

    if not must and (not path.is_file() or path.name == "session.json" or is_journal(path)):
        return
    try:
        add_analysis(path, result, options, now_utc(), analysed)
    except DataError as error:
        if must:
            raise
        warn(f"the result is not stored: {error}")


def say_warnings(notes: Iterable[LogEntry]) -> None:
    """Import warnings on stderr."""
    for note in notes:
        if note.level == "warning" and note.source == "import":
            warn(note.text)


def warn(*texts: str) -> None:
    """Warnings on stderr."""
    for text in filter(None, texts):
        click.echo(f"warning: {one_line(text)}", err=True)


def refuse_existing(path: Path) -> None:
    """Raise DataError for a path that cannot be a new file."""
    if os.path.lexists(path):
        raise DataError(message("{path}: exists already and is not overwritten", path=path), "Choose another name")
    if len(os.fsencode(path.name)) > NAME_BYTES:
        raise DataError(
            message("{name}…: is too long for the name of a file", name=path.name[:40]), "Choose a shorter one"
        )
    if not os.path.isdir(path.absolute().parent):
        raise DataError(
            message("{path}: there is no such folder", path=path.absolute().parent),
            "Make it first, or choose another",
        )


@contextmanager
def progress(label: str) -> Iterator[Progress | None]:
    """Yields the callback of a bar, or None without a terminal."""
    if not sys.stderr.isatty():
        yield None
        return
    with click.progressbar(length=1000, label=label, file=sys.stderr, show_eta=False) as bar:

        def on_progress(fraction: float, text: str) -> None:
            bar.label = f"{label} {text}"
            bar.update(max(0, round(1000 * fraction) - bar.pos))

        yield on_progress


def print_json(value: Mapping[str, Any]) -> None:
    """One JSON object; NaN becomes null."""
    from draglag.store import to_json

    click.echo(to_json(value))


def table(head: Sequence[str], rows: Sequence[Sequence[str]], left: int = 1) -> str:
    """A text table; the first ``left`` columns and the last are left-aligned."""
    widths = [max(len(row[k]) for row in [head, *rows]) for k in range(len(head))]

    def line(row: Sequence[str]) -> str:
        cells = [
            cell.ljust(width) if k < left or k == len(row) - 1 else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        return "  ".join(cells).rstrip()

    return "\n".join([line(head), line(["─" * width for width in widths]), *map(line, rows)])


def number(value: object, digits: int = 1) -> str:
    """A number for people; a dash if absent."""
    return "–" if not isinstance(value, int | float) or value != value else f"{value:.{digits}f}"


def flags_block(flags: Iterable[str]) -> list[str]:
    """A block of text with the meaning of each flag, to stand below their table; none without flags."""
    from draglag.latency.flags import meanings

    known = meanings(flags)
    width = max(map(len, known), default=0)
    return ["\n".join(["Flags", *(f"  {flag:<{width}}  {what}" for flag, what in known.items())])] if known else []


def checksum(path: Path) -> str:
    """SHA-256 of a file; empty for a folder."""
    if not path.is_file():
        return ""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def now_utc() -> str:
    """The present, ISO 8601."""
    return datetime.now(UTC).isoformat(timespec="seconds")
