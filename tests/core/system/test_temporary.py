"""Temporary folders of killed processes go, and nothing else does."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from draglag.system.temporary import sweep, temporary_for

_GROW = """
import sys
from pathlib import Path
from draglag.system.temporary import temporary_for
with temporary_for(Path(sys.argv[1])) as growing:
    growing.write_text("half")
    print("growing", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def killed(tmp_path: Path) -> Path:
    """The folder that a killed process left, with half a file in it."""
    with subprocess.Popen(
        [sys.executable, "-c", _GROW, str(tmp_path / "a.mat")], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        process.stdout.readline()
        assert sweep(tmp_path) == []  # its maker lives
        process.send_signal(signal.SIGKILL)
    (left,) = tmp_path.iterdir()
    assert [path.name for path in left.iterdir()] == ["a.mat"]
    return left


def test_a_finished_file_leaves_no_temporary_folder(tmp_path: Path) -> None:
    with temporary_for(tmp_path / "a") as growing:
        growing.write_text("whole")
        assert sweep(tmp_path) == []
        growing.rename(tmp_path / "a")
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("a", "whole")]


def test_what_failed_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(ValueError), temporary_for(tmp_path / "a") as growing:  # noqa: PT012
        growing.write_text("half")
        raise ValueError
    assert list(tmp_path.iterdir()) == []


def test_what_a_killed_process_left_is_swept_away(killed: Path) -> None:
    assert sweep(killed.parent) == [killed]
    assert list(killed.parent.iterdir()) == []


def test_nothing_else_is_touched(killed: Path, tmp_path: Path) -> None:
    name = killed.name
    kept = tmp_path / "kept"
    kept.mkdir()
    (kept / "mine").write_text("mine")
    (tmp_path / f"{name}0").mkdir()
    (tmp_path / name.replace(".draglag", "draglag")).mkdir()
    (tmp_path / (name[:-8] + "ABCDEF01")).mkdir()
    (tmp_path / (name[:-8] + "00000001")).write_text("a file of that name")
    (tmp_path / (name[:-8] + "00000002")).symlink_to(kept)
    (tmp_path / f".draglag-tmp-{os.getpid()}-1-00000003").mkdir()  # the number in use again: another process's
    (tmp_path / "a.h5.partial").write_text("a recording")
    before = {path.name for path in tmp_path.iterdir()}
    gone = {killed.name, f".draglag-tmp-{os.getpid()}-1-00000003"}
    assert {path.name for path in sweep(tmp_path)} == gone
    assert {path.name for path in tmp_path.iterdir()} == before - gone
    assert (kept / "mine").read_text() == "mine"


@pytest.mark.skipif(os.geteuid() != 0, reason="giving a folder to another account needs root")
def test_another_account_s_folder_stays(killed: Path) -> None:
    os.chown(killed, 12345, 12345)
    assert sweep(killed.parent) == []


def test_a_folder_whose_lock_is_held_elsewhere_stays(killed: Path) -> None:
    import fcntl

    descriptor = os.open(killed, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        assert sweep(killed.parent) == []
    finally:
        os.close(descriptor)
    assert sweep(killed.parent) == [killed]
