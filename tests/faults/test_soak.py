"""A session that lasts: 1 kHz of touch, a laser whose clock is compared 1000 times a second, and a WALT.

A few seconds by default; ``./run soak --minutes 60`` for as long as asked, which also prints the figures.
"""

from __future__ import annotations

import gc
import os
import threading
import time
import tomllib
from pathlib import Path

import numpy as np
import pytest

from draglag.presets import load_screen
from draglag.protocols import Protocol
from draglag.recording import ClockBounds, LaserTrace, Run, TouchTrace
from draglag.store import read_session
from draglag_app.session import Control, OffscreenDisplay, SessionOptions, events, run_session
from draglag_devices.rig import Rig
from draglag_devices.source import Batch, SourceInfo
from draglag_devices.stage import Stage
from draglag_devices.timebase import HostTime

SOAK_S = 60.0 * float(os.environ.get("DRAGLAG_SOAK_MINUTES", "0"))
# Of one run: what a session holds in memory grows up to the end of a run, and no further.
RUN_S = 2.0 if not SOAK_S else 60.0
# A protocol repeats a run at most 100 times.
RUNS = min(100, max(2, round(SOAK_S / (RUN_S + 2.0))))
RATE_HZ = 1000.0
# Growth of memory over an hour that is no leak (bytes), and from when on it counts: caches are full by then.
GROWTH = 20e6
SETTLED = 0.2
PROTOCOL = """
name = "soak"
rest_s = 0.2
[[runs]]
kind = "circle"
speed_mm_s = 200
duration_s = {duration}
repeats = {runs}
"""


class Ticks:
    """Samples at k / RATE_HZ on the host's clock, k counted without a hole; ``read`` gives those of the last 10 ms."""

    def __init__(self, role: str) -> None:
        self.role = role
        self.address = f"ticks:{role}"
        self._next = 0

    def open(self) -> SourceInfo:
        self._next = int(time.monotonic() * RATE_HZ) + 1
        return SourceInfo(self.address, self.role, "a steady stream", "CLOCK_MONOTONIC")

    def read(self, timeout_s: float) -> Batch:
        time.sleep(0.01)
        until = int(time.monotonic() * RATE_HZ)
        k = np.arange(self._next, until + 1)
        self._next = until + 1
        return self.batch(k, k / RATE_HZ)

    def batch(self, k: np.ndarray, t_s: np.ndarray) -> Batch:
        if self.role == "touch":
            raw = (k % 4096).astype(float)
            trace = TouchTrace(t_s, 50.0 + raw / 100.0, 60.0 + raw / 200.0, k * 0 + 7, raw, raw, t_s)
            return Batch(float(t_s[-1]) if len(k) else -np.inf, touch=trace)
        if self.role == "laser":
            edges = k[k % 125 == 0]
            laser = LaserTrace(edges / RATE_HZ, edges // 125 % 2, edges / RATE_HZ, edges * 0)
            clock = ClockBounds("laser", t_s, t_s - 1e-5, t_s + 1e-5, k * 0)
            return Batch(float(t_s[-1]) if len(k) else -np.inf, laser=laser, clock=clock)
        clock = ClockBounds("walt", t_s[:1], t_s[:1] - 1e-4, t_s[:1] + 1e-4)
        return Batch(float(t_s[-1]) if len(k) else -np.inf, clock=clock)

    def close(self) -> None:
        pass


class Meter(threading.Thread):
    """Memory, threads and descriptors of this process, once a second."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.rows: list[tuple[float, int, int, int]] = []
        self._end = threading.Event()

    def run(self) -> None:
        page = os.sysconf("SC_PAGE_SIZE")
        while not self._end.wait(1.0):
            memory = int(Path("/proc/self/statm").read_text().split()[1]) * page
            descriptors = len(os.listdir("/proc/self/fd"))
            self.rows.append((time.monotonic(), memory, threading.active_count(), descriptors))

    def stop(self) -> np.ndarray:
        self._end.set()
        self.join()
        return np.array(self.rows)


def count_samples(run: Run) -> tuple[int, int, int]:
    """Touch events, edges and comparisons of clocks of a run, every one of which is there and right."""
    k = np.rint(run.touch.t_s * RATE_HZ).astype(int)
    assert (np.diff(k) == 1).all(), run.id
    assert k[0] <= run.start_s * RATE_HZ + 1
    assert k[-1] >= (run.start_s + run.duration_s) * RATE_HZ - 1
    np.testing.assert_array_equal(run.touch.x_raw, k % 4096)
    np.testing.assert_array_equal(run.touch.x_mm, 50.0 + (k % 4096) / 100.0)
    edges = np.rint(run.laser.t_s * RATE_HZ).astype(int)
    assert (np.diff(edges) == 125).all(), run.id
    assert (run.touch.dropped, run.laser.missed, len(run.touch.gaps_s)) == (0, 0, 0)
    (bounds,) = [clock for clock in run.sync if clock.stream == "laser"]
    assert (np.diff(np.rint(bounds.device_s * RATE_HZ)) == 1).all(), run.id
    return len(k), len(edges), len(bounds.device_s)


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs /proc to see memory and descriptors")
def test_nothing_is_lost_and_nothing_grows(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    screen = load_screen("screen-1")
    source = PROTOCOL.format(duration=RUN_S, runs=RUNS)
    protocol = Protocol.model_validate(tomllib.loads(source))
    rig = Rig(tuple(Ticks(role) for role in ("touch", "laser", "walt")), Stage(HostTime(), "screen-1", 1))
    finished_s = [0.0]

    def listener(event: events.Event) -> None:
        if isinstance(event, events.RunFinished):
            finished_s[0] = time.monotonic()

    gc.collect()
    meter = Meter()
    meter.start()
    path = run_session(
        protocol,
        rig,
        OffscreenDisplay(),
        tmp_path / "s.h5",
        SessionOptions(screen, countdown_s=0.2),
        listener,
        Control(),
    )
    rows = meter.stop()
    session = read_session(path)
    assert [run.outcome for run in session.runs] == ["complete"] * RUNS
    counts = [count_samples(run) for run in session.runs]
    recording = rows[rows[:, 0] < finished_s[0]]  # afterwards the threads end and the session file is made
    settled = recording[int(SETTLED * len(recording)) :].astype(int)[:, 1:]
    middle = len(settled) // 2
    growth = float(np.median(settled[middle:, 0]) - np.median(settled[:middle, 0])) if middle else 0.0
    threads, fds = settled[:, 1].tolist(), settled[:, 2].tolist()
    if SOAK_S:
        with capsys.disabled():
            touch, edges, clock = (sum(column) for column in zip(*counts, strict=True))
            print(f"\n{len(counts)} runs, {touch} touch events, {edges} edges, {clock} comparisons of clocks, 0 lost")
            print(f"memory +{growth / 1e6:.1f} MB, threads {sorted(set(threads))}, descriptors {sorted(set(fds))}")
        assert growth < GROWTH
    assert len(set(threads)) <= 1, "threads come or go"
    # One more while the meter itself lists them.
    assert not fds or max(fds) - min(fds) <= 1, "descriptors come or go"
