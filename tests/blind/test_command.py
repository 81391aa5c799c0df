"""`draglag blind` as people meet it, without running the workflow."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest
from click.testing import CliRunner

from blind import benchmark
from blind.conditions import Task
from blind.judge import Outcome
from blind.places import run_all
from draglag_app.cli import blind as command
from draglag_app.cli import cli
from draglag_app.parallel import Unavailable


def test_says_that_it_needs_a_checkout(tmp_path, monkeypatch):
    monkeypatch.setattr(command, "__file__", str(tmp_path / "lib" / "draglag_app" / "cli" / "blind.py"))
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(cli, ["blind", "--quick"])
    assert result.exit_code == 1
    assert "needs a checkout" in result.stderr
    assert result.stdout == ""


def test_unknown_row_is_named():
    result = CliRunner().invoke(cli, ["blind", "--only", "no_such_effect"])
    assert result.exit_code == 1
    assert "no_such_effect" in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1


def test_cluster_without_scheduler_is_one_sentence(monkeypatch):
    monkeypatch.setattr("draglag_app.parallel.ANSWERS_S", 0.5)
    with pytest.raises(Unavailable) as caught:
        list(run_all([Task("none", "none", 1.0, 1)], jobs=1, scheduler="tcp://127.0.0.1:9"))
    assert caught.value.remedy
    assert "\n" not in str(caught.value)


START = "from draglag_app.cli.main import main; main()"


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def children(pid: int) -> list[int]:
    return [int(text) for text in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def hear_ctrl_c() -> None:
    """A shell starts what runs in the background without SIGINT."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs Linux's list of processes")
def test_ctrl_c_ends_it_and_its_workers():
    run = subprocess.Popen(
        [sys.executable, "-c", START, "blind", "--only", "none", "--sessions", "200", "--jobs", "2"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=Path(__file__).parents[2],
        preexec_fn=hear_ctrl_c,
    )  # fmt: skip
    workers: list[int] = []
    patience_s = time.monotonic() + 60
    try:
        while len(workers) < 3 and run.poll() is None:  # two, and the one that looks after what they share
            assert time.monotonic() < patience_s, "no workers"
            workers = children(run.pid)
        run.send_signal(signal.SIGINT)  # to the main process alone
        _, said = run.communicate(timeout=120)
    except BaseException:
        for pid in (run.pid, *workers):
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        raise
    assert run.returncode == 1, said
    assert "Traceback" not in said
    patience_s = time.monotonic() + 60
    while any(map(alive, workers)):
        assert time.monotonic() < patience_s, "workers left behind"


def test_what_was_done_before_ctrl_c_is_reported(monkeypatch):
    done = Outcome("none", "none", 1.0, 1, {}, True, (), (), "no_gap", None, None, None, None, 0.2, 0.2, 0.2, 1.0)

    def interrupted(chosen, jobs, scheduler, keep, engine):
        yield done
        raise KeyboardInterrupt

    monkeypatch.setattr(benchmark, "run_all", interrupted)
    result = CliRunner().invoke(cli, ["blind", "--world", "plain", "--only", "none", "--sessions", "3"])
    assert result.exit_code == 1
    assert "1 of 15 sessions were done" in result.stderr
    assert "False alarms" in result.stdout
