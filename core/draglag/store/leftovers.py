"""Files left by a recording killed while closing."""

from __future__ import annotations

import os
import re
from contextlib import suppress
from pathlib import Path

import h5py

from draglag.errors import DataError
from draglag.store.build import TEMPORARY, fill
from draglag.store.checksum import raw_checksum
from draglag.store.frames import Locked, lock
from draglag.store.journal import PARTIAL, all_losses, is_journal, nodes, open_journal, survey
from draglag.store.safely import BROKEN, open_session, text_attr
from draglag.store.salvage import final_name

_BUILDING = re.compile(rf"\..+\.[0-9a-f]{{8}}{re.escape(TEMPORARY)}\Z")


def clear_leftovers(folder: Path | str) -> list[Path]:
    """Paths deleted: unfinished session files, and journals that a session file holds whole."""
    gone: list[Path] = []
    folder = Path(folder)
    found = [path for path in folder.glob(f".*{TEMPORARY}") if _BUILDING.match(path.name)]
    found += [path for path in folder.glob(f"*{PARTIAL}") if is_journal(path) and _is_in_session(path)]
    for path in found:
        with suppress(OSError, Locked):
            fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
            try:
                if lock(fd):
                    path.unlink()
                    gone.append(path)
            finally:
                os.close(fd)
    return gone


def _is_in_session(journal: Path) -> bool:
    session = final_name(journal)
    if not session.is_file():
        return False
    try:
        with open_session(session) as file:
            present = raw_checksum(file)  # of what is there now, not what it was when it was made
        with open_journal(journal) as fd, h5py.File("journal", "w", driver="core", backing_store=False) as file:
            found = survey(fd, str(journal))
            fill(file, nodes(fd, found))
            return not all_losses(found) and present == text_attr(file, "raw_sha256", "")
    except (DataError, *BROKEN):
        return False
