"""Names that hold what a terminal would obey are printed without it."""

from __future__ import annotations

import os
import pty
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

from core.store_sessions import bare_session, full_run
from draglag.store import write_session

HOSTILE = "red\x1b[31m\x1b]0;title\x07\x9b2J\u202e\rbell"


def on_a_terminal(*command: str) -> str:
    """What a command prints where its standard output is a terminal."""
    ours, theirs = pty.openpty()
    with subprocess.Popen(command, stdout=theirs, stderr=subprocess.DEVNULL) as process:
        os.close(theirs)
        pieces = []
        try:
            while piece := os.read(ours, 4096):
                pieces.append(piece)
        except OSError:  # the other end is closed
            pass
    os.close(ours)
    assert process.returncode in (0, 1)
    return b"".join(pieces).decode("utf-8")


def test_a_session_s_name_gives_a_terminal_no_orders(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    write_session(replace(bare_session(full_run("run-01", 10.0)), name=HOSTILE), path)
    shown = on_a_terminal(
        sys.executable, "-c", "from draglag_app.cli import main; main()", "analyze", "--no-save", str(path)
    )
    assert "red [31m ]0;title 2J bell" in shown
    assert not set(shown) & set("\x1b\x07\x9b\u202e")
    assert shown.count("\n") > 3  # lines and columns stay
