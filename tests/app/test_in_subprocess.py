"""Computations in a process of their own."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from core import sound_sessions
from draglag.errors import DataError
from draglag_app.in_subprocess import run_in_subprocess, write_gap_of


def squares(n: int, progress: object) -> tuple[int, int]:
    progress(0.5, "half")
    return n * n, os.getpid()


def refuses(n: int, progress: object) -> None:
    raise DataError("the run has no edges", "record it again")


def dies(n: int, progress: object) -> None:
    os._exit(3)


def never_ends(n: int, progress: object) -> None:
    while True:
        pass


def quiet(fraction: float, text: str) -> None:
    pass


def test_result_comes_from_another_process() -> None:
    result, process = run_in_subprocess(squares, (7,), quiet)
    assert result == 49
    assert process != os.getpid()


def test_sentences_come_back() -> None:
    with pytest.raises(DataError, match="the run has no edges"):
        run_in_subprocess(refuses, (1,), quiet)


def test_the_windows_gap_report_has_the_provisional_term_that_the_window_shows(tmp_path: Path) -> None:
    """Of a session with an effect that may not be named."""
    found = sound_sessions.report_of_unnamed_skew()
    assert found.verdict == "unexplained"
    write_gap_of(sound_sessions.brief("scan_skew=0.03"), found, tmp_path / "gap.html", quiet)
    page = (tmp_path / "gap.html").read_text("utf-8")
    assert "Provisional term unnamed:" in page
    bars = re.findall(r"<svg.*?</svg>", page, re.DOTALL)[0]
    assert "<pattern" in bars  # hatched


def test_a_dead_process_is_reported() -> None:
    with pytest.raises(DataError, match="without a result"):
        run_in_subprocess(dies, (1,), quiet)


def test_cancelling_ends_it_at_once() -> None:
    calls = []

    def cancel(fraction: float, text: str) -> None:
        calls.append(fraction)
        if len(calls) == 3:
            raise KeyError("cancelled")

    with pytest.raises(KeyError):
        run_in_subprocess(never_ends, (1,), cancel)
