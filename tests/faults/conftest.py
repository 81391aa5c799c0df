"""Trials of the recording: bounded by default, all of them with ``./run faults``, which also prints the table."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from faults.stream import Verdict

ALL = os.environ.get("DRAGLAG_FAULTS") == "all"
_ROWS: list[Trial] = []


@dataclass
class Trial:
    """One row of the table: tries, and how many of them went wrong in which way."""

    name: str
    tries: int = 0
    lost: int = 0
    worst_lost_s: float = 0.0
    uncommitted_s: float = 0.0
    wrong: int = 0
    short: int = 0
    silent: int = 0
    other: int = 0

    def add(self, verdict: Verdict, seconds: float = 0.2) -> None:
        self.tries += 1
        self.lost += bool(verdict.lost)
        self.worst_lost_s = max(self.worst_lost_s, seconds * len(verdict.lost))
        self.uncommitted_s = max(self.uncommitted_s, verdict.uncommitted_s)
        self.wrong += verdict.wrong
        self.short += verdict.short
        self.silent += verdict.silent

    def must_be_clean(self, but_lost: bool = False) -> None:
        """Nothing lost (unless damage is the trial), nothing wrong, nothing that claims to be whole and is not."""
        assert self.tries > 0
        assert (self.wrong, self.short, self.silent, self.other) == (0, 0, 0, 0), self
        assert but_lost or self.lost == 0, self
        assert self.uncommitted_s <= 0.5, self


@pytest.fixture
def trial() -> Callable[[str], Trial]:
    """A new row of the table."""

    def make(name: str) -> Trial:
        _ROWS.append(Trial(name))
        return _ROWS[-1]

    return make


@pytest.fixture
def few_or_all() -> Callable[[int, int], int]:
    """How many tries: few by default, all of them for ``./run faults``."""
    return lambda few, every: every if ALL else few


@pytest.fixture
def folder() -> Iterator[Path]:
    """A folder in memory where there is one: trials write thousands of files."""
    memory = Path("/dev/shm")
    made = tempfile.mkdtemp(prefix="draglag-faults-", dir=memory if os.access(memory, os.W_OK) else None)
    yield Path(made)
    shutil.rmtree(made, ignore_errors=True)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    rows = [row for row in _ROWS if row.tries]
    if not rows or not ALL:
        return
    terminalreporter.write_sep("=", "trials of the recording")
    line = "{:<52} {:>6} {:>6} {:>8} {:>11} {:>6} {:>6} {:>6} {:>6}"
    terminalreporter.write_line(
        line.format("trial", "tries", "lost", "worst s", "uncommitted", "wrong", "short", "silent", "other")
    )
    for row in rows:
        terminalreporter.write_line(
            line.format(
                row.name, row.tries, row.lost, f"{row.worst_lost_s:.1f}", f"{row.uncommitted_s:.1f} s",
                row.wrong, row.short, row.silent, row.other,
            )
        )  # fmt: skip
