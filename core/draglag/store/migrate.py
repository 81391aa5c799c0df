"""An old session file in the present schema."""

from __future__ import annotations

from pathlib import Path

from draglag.store.analysis import add_analysis, read_analyses
from draglag.store.build import write_session
from draglag.store.read import read_session


def migrate(path: Path | str, out: Path | str) -> Path:
    """The path ``out``: the file in the present schema. Raises DataError: not a session file, or ``out`` exists."""
    written = write_session(read_session(path), out)
    for stored in read_analyses(path):
        options = {**stored.options, "migrated_from": stored.software}
        add_analysis(written, stored.result, options, stored.created_utc)
    return written
