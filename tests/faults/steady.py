"""Streams of known samples: 1 kHz of touch, a laser compared with the host 1000 times a second, a WALT.

The stylus circles in 1.5 s along the beam, reported 50 ms late. Times and places follow from a sample's number: lost,
repeated and changed samples are detected.
"""

from __future__ import annotations

import os
import threading
import time
from pathlib import Path

import numpy as np

from draglag.recording import Beam, ClockBounds, LaserTrace, Run, TouchTrace
from draglag_devices.source import Batch, SourceInfo

RATE_HZ = 1000.0
LATENCY_S = 0.05
RADIUS_MM = 48.0
BEAM = Beam(0.0, 140.0)
# Samples of one turn, half of which lies between two crossings of the beam's middle.
TURN = 1500
# The beam is dark from 17 ms before each crossing until 17 ms after it: a stylus of 6.8 mm.
DARK = 17
# The centre of the circle moves 100 mm there and 100 mm back in a minute.
_CENTRE_MM, _TRAVEL_MM, _TRAVEL = 150.0, 100.0, 60_000


def touched(k: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the touchscreen says the stylus is in its sample ``k``, mm."""
    phase = 2 * np.pi * (k - LATENCY_S * RATE_HZ) / TURN
    share = (k % _TRAVEL) / _TRAVEL
    centre = _CENTRE_MM + _TRAVEL_MM * 2 * np.minimum(share, 1 - share)
    return centre + RADIUS_MM * np.cos(phase), BEAM.intercept_mm + RADIUS_MM * np.sin(phase)


def edges_among(k: np.ndarray) -> np.ndarray:
    """Those of the samples at which the light goes or returns."""
    return k[np.isin(k % (TURN // 2), (TURN // 2 - DARK, DARK))]


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
        until_s = float(t_s[-1]) if len(k) else -np.inf
        if self.role == "touch":
            raw = (k % 4096).astype(float)
            return Batch(until_s, touch=TouchTrace(t_s, *touched(k), k * 0 + 7, raw, raw, t_s))
        if self.role == "laser":
            edges = edges_among(k)
            returns = (edges % (TURN // 2) == DARK).astype(int)
            laser = LaserTrace(edges / RATE_HZ, returns, edges / RATE_HZ, edges * 0)
            clock = ClockBounds("laser", t_s, t_s - 1e-5, t_s + 1e-5, k * 0)
            return Batch(until_s, laser=laser, clock=clock)
        return Batch(until_s, clock=ClockBounds("walt", t_s[:1], t_s[:1] - 1e-4, t_s[:1] + 1e-4))

    def close(self) -> None:
        pass


def count_samples(run: Run) -> tuple[int, int, int]:
    """Touch events, edges and comparisons of clocks of a run, every one of which is there and right."""
    k = np.rint(run.touch.t_s * RATE_HZ).astype(int)
    assert (np.diff(k) == 1).all(), run.id
    assert k[0] <= run.start_s * RATE_HZ + 1
    assert k[-1] >= (run.start_s + run.duration_s) * RATE_HZ - 1
    np.testing.assert_array_equal(run.touch.x_raw, k % 4096)
    np.testing.assert_array_equal((run.touch.x_mm, run.touch.y_mm), touched(k))
    edges = np.rint(run.laser.t_s * RATE_HZ).astype(int)
    np.testing.assert_array_equal(edges, edges_among(np.arange(edges[0], edges[-1] + 1)))
    assert edges[0] - k[0] < TURN // 2
    assert k[-1] - edges[-1] < TURN // 2
    assert (run.touch.dropped, run.laser.missed, len(run.touch.gaps_s)) == (0, 0, 0)
    (bounds,) = [clock for clock in run.sync if clock.stream == "laser"]
    assert (np.diff(np.rint(bounds.device_s * RATE_HZ)) == 1).all(), run.id
    return len(k), len(edges), len(bounds.device_s)


class Meter(threading.Thread):
    """Resident memory (bytes), threads and descriptors of this process, once a second.

    Threads of Qt's pools, counted separately, end after 30 s without work and begin again, each with an eventfd.
    """

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self._rows: list[tuple[float, int, int, int, int]] = []
        self._end = threading.Event()

    def run(self) -> None:
        page = os.sysconf("SC_PAGE_SIZE")
        while not self._end.wait(1.0):
            memory = int(Path("/proc/self/statm").read_text().split()[1]) * page
            names = [_text_of(task / "comm") for task in Path("/proc/self/task").iterdir()]
            pooled = names.count("Thread (pooled)")
            lasting = [fd for fd in Path("/proc/self/fd").iterdir() if "eventfd" not in _target_of(fd)]
            row = time.monotonic(), memory, len(names) - names.count("") - pooled, len(lasting), pooled
            self._rows.append(row)

    def stop(self) -> np.ndarray:
        """(s on the monotonic clock, bytes, threads, descriptors, pooled threads), (n, 5); one descriptor is that of
        the listing."""
        self._end.set()
        self.join()
        return np.array(self._rows).reshape(-1, 5)


def _text_of(path: Path) -> str:
    """What a file of /proc holds; empty where the thread has ended."""
    try:
        return path.read_text().strip()
    except OSError:
        return ""


def _target_of(path: Path) -> str:
    """What a descriptor is of; "eventfd" where it has been closed since it was listed."""
    try:
        return os.readlink(path)
    except OSError:
        return "eventfd"
