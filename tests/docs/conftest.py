"""One recorded and analysed session for all pages."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from draglag.analysis import analyze
from draglag.recording import LogEntry
from draglag.simulation import simulate_session
from draglag.store import add_analysis, write_session


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session file with notes and a stored result."""
    session = simulate_session("screen-1", "demo", seed=1)
    session = replace(session, notes=(LogEntry(0.0, "note", "operator", "Prüfling gereinigt, 21 °C"),))
    path = tmp_path_factory.mktemp("recorded") / "session.h5"
    write_session(session, path)
    add_analysis(path, analyze(session).to_dict(), {"estimator": "efficient"}, "2026-03-01T11:00:00+00:00")
    return path


@pytest.fixture
def folder(recorded: Path, tmp_path: Path) -> Path:
    """A folder with ``session.h5`` in it, for one page."""
    shutil.copy(recorded, tmp_path / "session.h5")
    return tmp_path
