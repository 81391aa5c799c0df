"""A long session: 1 kHz of touch, a laser compared 1000 times a second, and a WALT.

Some seconds by default; ``./run soak --minutes 60`` as long as requested, and prints the figures. ``--windows``:
recorded by the operator's and participant's windows, with live plots and estimates.
"""

from __future__ import annotations

import gc
import os
import time
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QCoreApplication, QEvent
from PySide6.QtWidgets import QApplication

from draglag.protocol.presets import load_screen
from draglag.protocol.runs import Protocol
from draglag.protocol.targets import Target
from draglag.store import read_session
from draglag_app.session import Control, OffscreenDisplay, SessionOptions, events, run_session
from draglag_app.windows.application import make_application
from draglag_app.windows.recording.session_thread import Order
from draglag_app.windows.settings import Settings
from draglag_app.windows.window import OperatorWindow
from draglag_devices.rig import Rig
from draglag_devices.stage import Stage
from draglag_devices.timebase import HostTime, TimeBase
from faults.steady import BEAM, LATENCY_S, Meter, Ticks, count_samples

SOAK_S = 60.0 * float(os.environ.get("DRAGLAG_SOAK_MINUTES", "0"))
WINDOWS = os.environ.get("DRAGLAG_SOAK_WINDOWS") == "1"
# Of one run, s: what a session holds in memory grows up to the end of a run, and no further. Two turns of the stylus: a
# run of 2 s that begins within 50 ms of a crossing has too few edges for a latency, and the window records it again.
RUN_S = min(60.0, SOAK_S / 10) if SOAK_S else 3.0
# A protocol repeats a run at most 100 times.
RUNS = min(100, max(2, round(SOAK_S / (RUN_S + 2.0))))
# Growth of memory over an hour that is no leak, bytes.
GROWTH = 20e6
# The recording is looked at by tenths; from this one on it has warmed up: caches are full, the first runs estimated.
SETTLED = 2
# A session that takes this much longer than its runs, and than each run's rest, end and estimate, hangs.
PATIENCE_S, PATIENCE_A_RUN_S = 120.0, 30.0
PROTOCOL = """
name = "soak"
rest_s = 0.2
[[runs]]
kind = "circle"
speed_mm_s = 200
duration_s = {duration}
repeats = {runs}
"""


def order(folder: Path, display: str) -> Order:
    protocol = Protocol.model_validate(tomllib.loads(PROTOCOL.format(duration=RUN_S, runs=RUNS)))
    rig = Rig(tuple(Ticks(role) for role in ("touch", "laser", "walt")), Stage(HostTime(), "screen-1", 1))
    options = SessionOptions(load_screen("screen-1"), beam=BEAM, countdown_s=0.2)
    return Order(protocol, rig, folder / "s.h5", options, display)


def check(path: Path, rows: np.ndarray, capsys: pytest.CaptureFixture[str]) -> None:
    """Every sample is in the session; ``rows`` of the meter, up to the last run's end, show no growth."""
    session = read_session(path)
    # Afterwards the threads end and the session file is made. Meter and session have the same clock.
    last = session.runs[-1]
    rows = rows[rows[:, 0] < last.start_s + last.duration_s]
    assert [run.outcome for run in session.runs] == ["complete"] * RUNS
    counts = [count_samples(run) for run in session.runs]
    tenths = np.array_split(rows, 10)
    settled = np.concatenate(tenths[SETTLED:]).astype(int)
    threads, fds, pooled = (settled[:, column].tolist() for column in (2, 3, 4))
    if SOAK_S:
        with capsys.disabled():
            touch, edges, clock = (sum(column) for column in zip(*counts, strict=True))
            print(f"\n{len(counts)} runs, {touch} touch events, {edges} edges, {clock} comparisons of clocks, 0 lost")
            memory = [float(np.median(part[:, 1])) for part in tenths]
            growth = memory[-1] - memory[SETTLED]
            print(f"memory {growth / 1e6:+.1f} MB (by tenths: {' '.join(f'{part / 1e6:.0f}' for part in memory)} MB)")
            print(f"threads {sorted(set(threads))}, descriptors {sorted(set(fds))}, pooled {sorted(set(pooled))}")
        assert growth < GROWTH
    assert len(set(threads)) <= 1, "threads come or go"
    # The window's two pools have a thread each, and Qt's own, with which it draws, one a processor.
    assert max(pooled, default=0) <= 2 + (os.cpu_count() or 1), "pools grow"
    # One more while the meter itself lists them.
    assert not fds or max(fds) - min(fds) <= 1, "descriptors come or go"


needs_proc = pytest.mark.skipif(
    not Path("/proc/self/statm").exists(), reason="needs /proc to see memory and descriptors"
)


@needs_proc
@pytest.mark.skipif(WINDOWS, reason="with windows")
def test_nothing_is_lost_and_nothing_grows(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    gc.collect()
    asked = order(tmp_path, "offscreen")
    meter = Meter()
    meter.start()
    path = run_session(
        asked.protocol, asked.rig, OffscreenDisplay(), asked.out, asked.options, lambda event: None, Control()
    )  # fmt: skip
    check(path, meter.stop(), capsys)


class BusyDisplay(OffscreenDisplay):
    """On a machine so busy that the target is drawn a tenth of a second after it should have started to move."""

    def __init__(self, time: TimeBase) -> None:
        super().__init__()
        self._time = time

    def show(self, target: Target, start_s: float) -> None:
        super().show(target, start_s)
        while self._time.now() <= start_s + 0.1:
            pass


@pytest.mark.skipif(bool(SOAK_S), reason="a soak is asked for")
def test_a_late_display_loses_no_sample_of_a_run_s_begin(tmp_path: Path) -> None:
    asked = order(tmp_path, "offscreen")
    display = BusyDisplay(asked.rig.stage.time_base)
    options = replace(asked.options, countdown_s=0.02)
    path = run_session(asked.protocol, asked.rig, display, asked.out, options, lambda event: None, Control())
    for run in read_session(path).runs:
        count_samples(run)


@pytest.fixture
def window(qapp: QApplication, tmp_path: Path) -> Iterator[OperatorWindow]:
    """The operator's window, on its Record page."""
    settings = Settings(first_start=False, folder=str(tmp_path))
    make_application([], settings)
    made = OperatorWindow(settings, tmp_path / "settings.toml")
    made.resize(1280, 800)
    made.show()
    yield made
    made.shut_down()
    wait(qapp, lambda: not made.space.recording.active, PATIENCE_S)  # or closing would ask whether to stop
    made.space.tasks.finish()
    made.close()
    made.deleteLater()
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)


@needs_proc
@pytest.mark.skipif(bool(SOAK_S) and not WINDOWS, reason="without windows")
def test_nothing_is_lost_and_nothing_grows_with_windows_open(
    qapp: QApplication, window: OperatorWindow, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    space, ended, frames = window.space, [], []

    def over(event: events.RunFinished) -> None:
        frames.append(0 if event.run.display is None else len(event.run.display.t_s))

    space.bridge.run_finished.connect(over)
    space.recording.ended.connect(lambda path, problem: ended.append((path, problem)))
    meter = Meter()
    meter.start()
    asked = order(tmp_path, "window")
    space.recording.start(asked)
    window.go("record")
    wait(qapp, lambda: bool(ended), RUNS * (RUN_S + PATIENCE_A_RUN_S) + PATIENCE_S)
    rows = meter.stop()
    assert ended == [(asked.out, "")]
    check(asked.out, rows, capsys)
    assert min(frames) > 0, "the participant's window showed no target"
    # Short runs have too few edges for an estimate that could be compared.
    wait(qapp, lambda: len(space.live.known) == RUNS and not space.live.preliminary, PATIENCE_S)
    if SOAK_S:
        assert [run.latency_s for run in space.live.known] == pytest.approx([LATENCY_S] * RUNS, abs=0.002)


def wait(qapp: QApplication, so: Callable[[], bool], at_most_s: float) -> None:
    """Handle the windows' events as they come until something is so."""
    give_up_s = time.monotonic() + at_most_s
    while not so():
        qapp.processEvents()
        time.sleep(0.002)  # shorter than a frame
        assert time.monotonic() < give_up_s, "the session did not end"
