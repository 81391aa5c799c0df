"""``draglag verify``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from draglag.errors import DataError
from draglag_app.cli.common import json_option, print_json

if TYPE_CHECKING:
    from draglag.store import Finding

_STATES = {
    "sound": "sound",
    "incomplete": "incomplete: measured data are missing, what is there can be used",
    "damaged": "damaged",
}


@click.command("verify")
@click.argument("session", type=click.Path(path_type=Path))
@click.option("--out", type=click.Path(path_type=Path), help="Where to save what an unfinished file holds.")
@json_option
def verify(session: Path, out: Path | None, as_json: bool) -> None:
    """Check SESSION against the schema and its contents against sense: it is sound, incomplete (measured data are
    missing; what is there can be used) or damaged. A file that was never finished (its name ends on .partial), or a
    damaged one with --out, is saved: everything readable goes to a new file, the old one stays. An exchange folder is
    checked too.

    \b
    Examples:
        draglag verify session.h5
        draglag verify session.h5.partial --out saved.h5
    """
    from draglag.store import grade

    findings, saved = _checked(session, out)
    state = grade(findings)
    errors = [finding for finding in findings if finding.level == "error"]
    if as_json:
        rows = [{"level": f.level, "where": f.where, "text": f.text} for f in findings]
        about = {"session": str(session), "ok": state == "sound", "state": state, "saved": saved and str(saved)}
        print_json({**about, "findings": rows})
        if errors:
            click.echo(str(errors[0]), err=True)
    else:
        _print(session, saved, findings, "" if errors else _STATES[state])
    if errors:
        raise click.exceptions.Exit(1)


def _checked(session: Path, out: Path | None) -> tuple[list[Finding], Path | None]:
    """What is wrong, and the file that an unfinished or damaged one was saved as."""
    from draglag.store import Finding, salvage
    from draglag.store import verify as check

    if session.is_dir():
        return _folder(session), None
    if session.exists() and (out is not None or _unfinished(session)):
        result = salvage(session, out)
        return [Finding("loss", str(session), loss) for loss in result.losses] + check(result.path), result.path
    return check(session), None


def _print(session: Path, saved: Path | None, findings: list[Finding], state: str) -> None:
    for finding in findings:
        click.echo(str(finding), err=finding.level == "error")
    if saved is not None:
        click.echo(f"{saved}: saved from {session.name}")
    if state:
        remarks = f", {len(findings)} remarks" if findings else ""
        click.echo(f"{saved or session}: {state}{remarks}")


def _unfinished(session: Path) -> bool:
    from draglag.store import PARTIAL, final_name

    return session.name.endswith(PARTIAL) and not final_name(session).exists()


def _folder(folder: Path) -> list[Finding]:
    from draglag.exchange import read_exchange
    from draglag.store import Finding, check_session

    try:
        session = read_exchange(folder)
    except DataError as error:
        return [Finding("error", str(folder), str(error).removeprefix(f"{folder}: "))]
    return [Finding("warning", "import", note.text) for note in session.notes] + check_session(session)
