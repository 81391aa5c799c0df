"""A command that was killed leaves nothing behind after the next one."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from draglag.exchange import read_exchange
from draglag.store import write_session
from draglag_app.leftovers import sweep_for

SAMPLE = Path(__file__).parent.parent / "data" / "exchange" / "none-A"
# The command, ended by SIGKILL in the moment in which what it made would get its name.
_KILLED = """
import os, signal, sys
from pathlib import Path
def die(*arguments, **more): os.kill(os.getpid(), signal.SIGKILL)
os.link = os.replace = os.rename = Path.rename = die
from draglag_app.cli import main
main(sys.argv[1:])
"""


@pytest.mark.parametrize("command", [
    ("analyze", "{session}", "--save"),
    ("export", "{session}", "--to", "netcdf", "--out", "{folder}/out/a.nc"),
    ("analyze", "{session}", "--no-save", "--save-model", "{folder}/out/model.json"),
    ("analyze", "{session}", "--no-save", "--report", "{folder}/out"),
    ("import", "{sample}", "--out", "{folder}/out/b.h5"),
    ("export", "{session}", "--to", "exchange", "--out", "{folder}/out/again"),
], ids=" ".join)  # fmt: skip
def test_what_a_killed_command_left_is_gone_after_the_next_start(tmp_path: Path, command: tuple[str, ...]) -> None:
    session, out = tmp_path / "s" / "a.h5", tmp_path / "out"
    session.parent.mkdir()
    out.mkdir()
    whole = read_exchange(SAMPLE)
    write_session(replace(whole, runs=whole.runs[:5]), session)
    content = session.read_bytes()
    arguments = [word.format(session=session, folder=tmp_path, sample=SAMPLE) for word in command]
    done = subprocess.run([sys.executable, "-c", _KILLED, *arguments], capture_output=True, check=False)
    assert done.returncode == -9, done.stderr
    left = [*session.parent.glob(".*"), *out.glob(".*")]
    assert len(left) == 1
    assert sweep_for(arguments) == left
    assert os.listdir(session.parent) == ["a.h5"]
    assert not [path for path in out.rglob("*") if path.is_file()]
    assert session.read_bytes() == content
