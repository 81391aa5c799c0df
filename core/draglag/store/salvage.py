"""A killed recording's journal, or a damaged session file, salvaged."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path

from draglag.errors import DataError
from draglag.messages import Message, joined, message
from draglag.recording import LogEntry, Session
from draglag.store.build import build, write_session
from draglag.store.journal import PARTIAL, all_losses, is_journal, lock_journal, nodes, open_journal, remarks, survey
from draglag.store.old_partial import recover
from draglag.store.read import read_unchecked
from draglag.system.temporary import refuse

_ANOTHER = message("Give another name with --out")


@dataclass(frozen=True)
class Salvaged:
    session: Session
    path: Path
    losses: tuple[str, ...]


def partial_files(folder: Path | str) -> list[Path]:
    """Unfinished recordings that have not been salvaged."""
    found = sorted(Path(folder).glob(f"*{PARTIAL}"))
    return [path for path in found if not final_name(path).exists() and not _salvaged_name(path).exists()]


def final_name(unfinished: Path | str) -> Path:
    """``session.h5.partial`` → ``session.h5``; another name gets ``-salvaged``."""
    path = Path(unfinished)
    return path.with_name(path.name.removesuffix(PARTIAL)) if path.name.endswith(PARTIAL) else _salvaged_name(path)


def salvage(unfinished: Path | str, out: Path | str | None = None) -> Salvaged:
    """Everything readable of an unfinished or damaged file, in a whole one; the old file stays.

    Runs without an end become "aborted", complete ones with missing rows "failed". Without file locks the recording may
    still go on: the session is then named ``-salvaged``. Raises DataError when nothing can be saved, or ``out`` exists.
    """
    unfinished = Path(unfinished)
    target = Path(out) if out is not None else final_name(unfinished)
    refuse(target, _ANOTHER)
    if not is_journal(unfinished):
        session, losses = recover(unfinished)
        note = _note(unfinished, tuple(losses), session)
        session = replace(session, notes=(*session.notes, note))
        return Salvaged(session, write_session(session, target), tuple(losses))
    with open_journal(unfinished) as fd:
        if not lock_journal(fd, unfinished) and out is None:
            target = _salvaged_name(final_name(unfinished))
            refuse(target, _ANOTHER)
        found = survey(fd, str(unfinished))
        lost = all_losses(found)
        note = LogEntry(found.last_s, "warning", "salvage", _words(unfinished, remarks(found)))
        try:
            path = build(nodes(fd, found, [note]), target, os.fstat(fd).st_size)
        except DataError as error:
            raise DataError(error.problem, "Make room there, or give another place with --out") from error
    return Salvaged(read_unchecked(path), path, lost)


def _note(unfinished: Path, losses: tuple[str, ...], session: Session) -> LogEntry:
    last_s = max((run.start_s + run.duration_s for run in session.runs), default=0.0)
    return LogEntry(last_s, "warning", "salvage", _words(unfinished, losses))


def _words(unfinished: Path, losses: tuple[str, ...]) -> Message:
    return joined("; ", (message("saved from {file}", file=unfinished.name), *losses))


def _salvaged_name(path: Path) -> Path:
    path = path.with_name(path.name.removesuffix(PARTIAL))
    return path.with_name(f"{path.stem}-salvaged{path.suffix}")
