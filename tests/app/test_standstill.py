"""A stopped or suspended recording says so in the file; the wall clock has no part in it."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from app.session_rigs import ROLES, Recording, protocol
from draglag.analysis import analyze
from draglag.recording import LogEntry
from draglag.store import read_session
from draglag_app.session.standstill import LATE_S, Pulse, Standstill
from draglag_devices.rig import make_rig

# A session in real time that stops itself in the middle of its run and is woken three seconds later.
_STOPPED = """
import os, signal, subprocess, sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from app.session_rigs import Recording, protocol
from draglag_app.session import events
from draglag_devices.rig import make_rig
stopped = []
def listen(control, event):
    if isinstance(event, events.SamplesArrived) and event.run_id and event.count and not stopped:
        stopped.append(subprocess.Popen(["sh", "-c", f"sleep 3; kill -CONT {os.getpid()}"]))
        os.kill(os.getpid(), signal.SIGSTOP)
    if isinstance(event, events.NoticeRaised):
        print(event.level, event.source, event.text)
rig = make_rig(dict.fromkeys(("touch", "laser"), "sim:"), "screen-1", 1, fast=False)
error = Recording(protocol(300, duration_s=3.0), rig, Path(sys.argv[1]), listen).error
if error: raise error
"""


def at(*readings: tuple[float, float]) -> Pulse:
    """A pulse that sees these readings of CLOCK_MONOTONIC and CLOCK_BOOTTIME, one after the other."""
    clocks: Iterator[tuple[float, float]] = iter(readings)
    return Pulse(lambda: next(clocks))


def test_a_stopped_program_is_distinguished_from_a_suspended_computer() -> None:
    stopped = at((10.0, 50.0), (15.0, 55.0)).take()
    assert stopped == [Standstill(10.0, 15.0, 0.0)]
    assert "did not run for 5.0 s" in stopped[0].message()
    slept = at((10.0, 50.0), (10.05, 3650.05)).take()
    assert "suspended for 3600.0 s" in slept[0].message()


def test_what_a_busy_computer_delays_a_little_is_nothing() -> None:
    pulse = at((0.0, 0.0), (LATE_S, LATE_S), (2 * LATE_S, 2 * LATE_S))
    assert pulse.take() == []
    assert pulse.take() == []


def test_a_standstill_is_reported_once() -> None:
    pulse = at((0.0, 0.0), (5.0, 5.0), (5.1, 5.1))
    assert len(pulse.take()) == 1
    assert pulse.take() == []


def test_a_run_in_which_the_program_was_stopped_says_so(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    tests = str(Path(__file__).parents[1])
    done = subprocess.run(
        [sys.executable, "-c", _STOPPED, str(path), tests], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "error standstill this program did not run for " in done.stdout
    session = read_session(path)
    (entry,) = [entry for entry in session.runs[0].log if entry.source == "standstill"]
    assert entry.level == "error"
    assert "did not run for " in entry.text
    assert analyze(session).excluded == {"run-01": "standstill"}


def test_such_a_run_stays_out_of_the_curve_unless_it_is_asked_for(tmp_path: Path) -> None:
    rig = make_rig(dict.fromkeys(("touch", "laser"), "sim:"), "screen-1", 1, fast=True)
    session = read_session(Recording(protocol(300), rig, tmp_path / "s.h5").path)
    run = session.runs[0]
    stood = replace(run, log=(*run.log, LogEntry(run.start_s, "error", "standstill", "the computer was suspended")))
    found = analyze(replace(session, runs=(stood,)))
    assert found.excluded == {run.id: "standstill"}
    assert "standstill" in found.runs[0].flags
    assert analyze(session).excluded == {}


def test_steps_of_the_wall_clock_change_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    steps = iter(range(10**9))

    def stepping() -> float:
        return 1.7e9 + (-1) ** next(steps) * 3600.0

    monkeypatch.setattr(time, "time", stepping)
    monkeypatch.setattr(time, "time_ns", lambda: int(1e9 * stepping()))
    before_s = time.monotonic()
    rig = make_rig(dict.fromkeys(ROLES, "sim:"), "screen-1", 1, fast=False)
    recording = Recording(protocol(300, duration_s=1.0), rig, tmp_path / "s.h5")
    run = read_session(recording.path).runs[0]
    assert run.outcome == "complete"
    assert before_s <= run.touch.t_s[0] <= run.touch.t_s[-1] <= time.monotonic()
    assert (run.touch.t_s[1:] >= run.touch.t_s[:-1]).all()
    assert [entry.text for entry in run.log if entry.level != "info"] == []
