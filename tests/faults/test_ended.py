"""A recording whose process is ended: killed at any time, or asked to end by a signal."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from draglag.store import SessionWriter, read_session
from faults.conftest import Trial
from faults.stream import HEADER, commits, in_journal, in_session, judge, play

PLAN = commits()
DRAGLAG = (sys.executable, "-c", "from draglag_app.cli import main; main()")
ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
PROTOCOL = """
name = "two"
rest_s = 0.2
[[runs]]
kind = "circle"
speed_mm_s = 300
duration_s = 30
[[runs]]
kind = "circle"
speed_mm_s = 600
duration_s = 30
"""


def record_in_child(folder: Path) -> tuple[int, int]:
    """A process that records, closes and ends; and where the numbers of its commits can be read."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            writer = SessionWriter(folder / "s.h5", HEADER)
            play(writer, PLAN, lambda number: os.write(write, number.to_bytes(2, "little")) and None)
            writer.close()
        finally:
            os._exit(0)
    os.close(write)
    return child, read


def test_killed_at_random(folder: Path, trial: Callable[[str], Trial], few_or_all: Callable[[int, int], int]) -> None:
    row = trial("SIGKILL at a random moment")
    began = time.monotonic()
    child, read = record_in_child(folder)
    os.waitpid(child, 0)
    os.close(read)
    whole_s = time.monotonic() - began
    rng = random.Random(5)
    for _ in range(few_or_all(10, 60)):
        shutil.rmtree(folder)
        folder.mkdir()
        child, read = record_in_child(folder)
        time.sleep(rng.uniform(0.0, 1.1 * whole_s))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        with os.fdopen(read, "rb") as pipe:
            said = pipe.read()
        done = int.from_bytes(said[-2:], "little") if said else -1
        final, journal = folder / "s.h5", folder / "s.h5.partial"
        if final.exists():
            row.add(judge(in_session(final), PLAN, len(PLAN) - 1))
        elif journal.exists() and (done >= 0 or journal.stat().st_size >= 4096):
            row.add(judge(in_journal(journal), PLAN, done))
        else:
            row.tries += 1
            row.other += done >= 0
    row.must_be_clean()


def test_a_signal_ends_the_session_in_order(tmp_path: Path, trial: Callable[[str], Trial]) -> None:
    """What a person, a shutdown and a closed terminal send, during a run."""
    (tmp_path / "two.toml").write_text(PROTOCOL)
    children = {number: begin_to_record(tmp_path / f"{number.name}.h5", tmp_path / "two.toml") for number in ENDING}
    until_s = time.monotonic() + 60.0
    try:
        for number, child in children.items():
            partial = tmp_path / f"{number.name}.h5.partial"
            # By then the run has begun and some of its samples are on the disk.
            while not (partial.exists() and partial.stat().st_size > 10 * 4096):
                assert child.poll() is None, child.communicate()
                assert time.monotonic() < until_s
                time.sleep(0.05)
            child.send_signal(number)
        for number, child in children.items():
            said, complaint = child.communicate(timeout=60)
            assert child.returncode == 1
            assert "Traceback" not in complaint
            assert "Stopped by the operator" in complaint
            assert f"{number.name}.h5" in said + complaint
    finally:
        for child in children.values():
            child.kill()
            child.wait()
    for number in ENDING:
        (run,) = read_session(tmp_path / f"{number.name}.h5").runs
        assert run.outcome == "aborted"
        assert len(run.touch.t_s) > 10
        trial(f"{number.name} during a run").tries += 1
    assert len(list(tmp_path.iterdir())) == 4


def begin_to_record(out: Path, protocol: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [*DRAGLAG, "record", str(protocol), "--touch", "sim:", "--laser", "sim:", "--realtime", "--out", str(out)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=hear_signals,
    )


def hear_signals() -> None:
    """A shell starts what runs in the background without SIGINT, nohup without SIGHUP; the trial sends both."""
    for number in ENDING:
        signal.signal(number, signal.SIG_DFL)


def test_verify_of_what_a_kill_left_saves_it_and_says_what_it_is(folder: Path) -> None:
    child, read = record_in_child(folder)
    for _ in range(30):
        os.read(read, 2)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    os.close(read)
    result = subprocess.run(
        [*DRAGLAG, "verify", str(folder / "s.h5.partial"), "--json"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    said = json.loads(result.stdout)
    assert said["state"] == "incomplete"
    assert said["saved"] == str(folder / "s.h5")
    assert any("cut off" in finding["text"] for finding in said["findings"])
