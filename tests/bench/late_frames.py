"""What went on before a frame of the target that came too late, and what the machine had to do with it."""

from __future__ import annotations

import functools
import gc
import os
import subprocess
import sys
import threading
import time
from collections import deque
from typing import Any

import numpy as np
from PySide6.QtCore import QAbstractEventDispatcher

from draglag.store import SessionWriter
from draglag_app.session.saver import Saver
from draglag_app.windows.bridge import SessionBridge
from draglag_app.windows.header import Header
from draglag_app.windows.participant.frame_log import FrameLog
from draglag_app.windows.participant.window import ParticipantWindow
from draglag_app.windows.plots.plot import Plot
from draglag_app.windows.recording.live_plots import SpeedPlot, TracePlot
from draglag_app.windows.recording.live_view import LiveView

_RATE_HZ = 60.0
# Shorter work than this holds nothing up.
_SHORT_S = 0.0005
# The window's thread is busy that often, but seldom for longer than this.
_LONG_S = 0.003
_MOST_LISTED = 8
_WATCHED = (
    (ParticipantWindow, "_tick", "frame"),
    (ParticipantWindow, "paintEvent", "frame drawn"),
    (LiveView, "_draw", "live plots"),
    (TracePlot, "draw", "trace plot's lines"),
    (SpeedPlot, "draw", "speed plot's lines"),
    (Plot, "paintEvent", "a plot drawn"),
    (SessionBridge, "_deliver", "session's events"),
    (Header, "_tick", "header's clock"),
    (Saver, "_take_batch", "writer: batch"),
    (Saver, "_emit_pending", "writer: events"),
    (SessionWriter, "flush", "writer: flush"),
)
# Wakes for each slot of the same grid, and computes after some of them for as long as the live plots do. Prints, a line
# each time, which slot it woke for and when, s after its start.
_BARE = """
import select, sys, time

def compute(steps):
    begun_s, sum = time.thread_time(), 0
    for step in range(steps):
        sum += step * step
    return time.thread_time() - begun_s

rate_hz, work_s, every = map(float, sys.argv[1:])
steps = int(1000 * work_s / min(compute(1000) for _ in range(200)))
start_s, woken, slot = time.monotonic(), [], 0
while True:
    now_s = time.monotonic() - start_s
    slot = int(now_s * rate_hz) + 1
    if select.select([sys.stdin], [], [], max(0.0, slot / rate_hz - now_s))[0]:
        break
    woken.append((slot, time.monotonic() - start_s))
    if len(woken) % every == 0:
        compute(steps)
print("\\n".join(f"{slot} {t_s:.6f}" for slot, t_s in woken))
"""
_PLOTS_S, _PLOTS_EVERY = 0.004, 6


class BareProcess:
    """Does nothing but keep that grid: what it misses, no program on this machine keeps."""

    def __init__(self) -> None:
        rhythm = [str(value) for value in (_RATE_HZ, _PLOTS_S, _PLOTS_EVERY)]
        self._process = subprocess.Popen(
            [sys.executable, "-I", "-S", "-c", _BARE, *rhythm], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def end(self) -> tuple[list[float], int]:
        """How long after the slot's beginning it woke, s, each time; and how many slots it missed."""
        reported, _ = self._process.communicate("")
        woken = [(int(slot), float(t_s)) for slot, t_s in (line.split() for line in reported.splitlines())]
        # A timer may wake a little early: that is not the slot before.
        slots = {max(slot, int(t_s * _RATE_HZ)) for slot, t_s in woken}
        late_s = [max(0.0, t_s - slot / _RATE_HZ) for slot, t_s in woken]
        return late_s, max(slots) - min(slots) + 1 - len(slots)


def _opened(path: str) -> int | None:
    """To be read sixty times a second; None where the system has no such file."""
    try:
        return os.open(path, os.O_RDONLY)
    except OSError:
        return None


class LateFrames:
    """Records the threads' work, and how long the window's thread waited for a core.

    Create before the application's windows; ``listen`` once there is an application.
    """

    def __init__(self) -> None:
        self._spans: deque[tuple[float, float, str, bool]] = deque(maxlen=4000)
        self._gc_s = self._awake_s = self._awake_cpu_s = 0.0
        self._depths_s: list[float] = []
        self._late: list[str] = []
        self._own_work = 0
        self._start_s: float | None = None
        self._before: tuple[float, float, float] | None = None
        self._bare: BareProcess | None = None
        self._bare_s: list[float] = []
        self._bare_missed = 0
        self._main = threading.get_ident()
        self._schedstat = _opened(f"/proc/self/task/{threading.get_native_id()}/schedstat")
        for owner, name, words in _WATCHED:
            setattr(owner, name, self._watched(getattr(owner, name), words))
        gc.callbacks.append(self._collected)
        add = FrameLog.add

        def added(log: FrameLog, t_s: float, x_mm: float, y_mm: float, missed: int) -> None:
            add(log, t_s, x_mm, y_mm, missed)
            self._frame(t_s, missed)

        FrameLog.add = added  # type: ignore[method-assign]

    def listen(self) -> None:
        """To the event loop of the window's thread."""
        loop = QAbstractEventDispatcher.instance()
        loop.awake.connect(self._awake)
        loop.aboutToBlock.connect(self._about_to_sleep)

    def begin(self, start_s: float) -> None:
        """The target moves from that time on."""
        self._start_s, self._before = start_s, None
        self._bare = BareProcess()

    def end(self) -> None:
        """The target stands."""
        self._start_s = None
        if self._bare is not None:
            self._bare_s, self._bare_missed = self._bare.end()

    def reported(self) -> str:
        """Every late frame with what went on before it, and how the machine kept time meanwhile."""
        lines = self._late[:_MOST_LISTED]
        if len(self._late) > _MOST_LISTED:
            lines.append(f"  … and {len(self._late) - _MOST_LISTED} more")
        if self._late:
            lines.append(
                f"late frames before which the window's thread itself worked for longer than a slot: {self._own_work} "
                f"of {len(self._late)}"
            )
        lines.append(f"slots missed by a process that only keeps that grid: {self._bare_missed}")
        for name, late_s in (("frames are drawn", self._depths_s), ("that process wakes", self._bare_s)):
            if late_s:
                p50, p99, p999, most = 1e3 * np.percentile(late_s, [50, 99, 99.9, 100])
                spread = f"{p50:.1f} / {p99:.1f} / {p999:.1f} / {most:.1f} ms"
                lines.append(f"{name} after the slot begins, p50 / p99 / p99.9 / max: {spread}")
        return "\n".join(lines)

    def _awake(self) -> None:
        self._awake_s, self._awake_cpu_s = time.monotonic(), time.thread_time()

    def _about_to_sleep(self) -> None:
        now_s = time.monotonic()
        if self._awake_s and now_s - self._awake_s > _LONG_S:
            own_ms = 1e3 * (time.thread_time() - self._awake_cpu_s)
            self._spans.append((self._awake_s, now_s, f"window's thread busy, {own_ms:.1f} ms of it own CPU", True))

    def _watched(self, work: Any, words: str) -> Any:
        @functools.wraps(work)
        def watched(*arguments: Any, **named: Any) -> Any:
            start_s = time.monotonic()
            try:
                return work(*arguments, **named)
            finally:
                end_s = time.monotonic()
                if end_s - start_s > _SHORT_S:
                    self._spans.append((start_s, end_s, words, threading.get_ident() == self._main))

        return watched

    def _collected(self, phase: str, facts: dict[str, int]) -> None:
        if phase == "start":
            self._gc_s = time.monotonic()
        else:
            end_s = time.monotonic()
            if end_s - self._gc_s > _SHORT_S:
                words = f"garbage of generation {facts['generation']}"
                self._spans.append((self._gc_s, end_s, words, threading.get_ident() == self._main))

    def _used(self) -> tuple[float, float]:
        """Of the window's thread: CPU s, and s it could have run but had no core."""
        if self._schedstat is None:
            return 0.0, 0.0
        cpu, waited = os.pread(self._schedstat, 100, 0).split()[:2]
        return float(cpu) / 1e9, float(waited) / 1e9

    def _frame(self, t_s: float, missed: int) -> None:
        if self._start_s is None:
            return
        now = (t_s, *self._used())
        before, self._before = self._before, now
        self._depths_s.append((t_s - self._start_s) % (1 / _RATE_HZ))
        if not missed or before is None:
            return
        cpu, waited = (1e3 * (b - a) for a, b in zip(before[1:], now[1:], strict=True))
        self._own_work += cpu > 1e3 / _RATE_HZ
        lines = [
            f"  {missed} missed at {t_s - self._start_s:.2f} s, {1e3 * (t_s - before[0]):.1f} ms after the last frame: "
            f"own CPU {cpu:.1f} ms, waited for a core {waited:.1f} ms"
        ]
        if now[0] - self._awake_s > _LONG_S:
            lines.append(f"    busy for {1e3 * (now[0] - self._awake_s):.1f} ms when it was drawn")
        for start_s, end_s, words, main in sorted(span for span in self._spans if span[1] > before[0]):
            from_ms, to_ms = 1e3 * (start_s - before[0]), 1e3 * (end_s - before[0])
            lines.append(f"    {from_ms:+6.1f} … {to_ms:+6.1f} ms  {words}{'' if main else ' (another thread)'}")
        self._late.append("\n".join(lines))
