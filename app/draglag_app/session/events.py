"""Events of a session; data are in the file before their event."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from draglag.protocol.runs import PlannedRun
from draglag.recording import ClockBounds, FloatArray, IntArray, Run
from draglag_app.session.machine import Phase
from draglag_devices.source import Batch


def _floats() -> FloatArray:
    return np.empty(0)


@dataclass(frozen=True)
class DeviceOpened:
    """A source is open; once each, before any run."""

    role: str
    address: str
    description: str


@dataclass(frozen=True)
class StateChanged:
    """A run's phase; ``remaining_s``: to the target's start in "countdown", else to its end."""

    run_id: str
    phase: Phase
    remaining_s: float = 0.0
    run_number: int = 0
    run_count: int = 0


@dataclass(frozen=True)
class Resting:
    """A rest began.

    Attributes:
        remaining_s: infinite where the operator ends it.
        coming: what follows: "run", "taps" or "clocks".
        repeats: whether the last run can be recorded again.
    """

    remaining_s: float
    coming: str = "run"
    repeats: bool = True


@dataclass(frozen=True)
class RunQueued:
    """A run went wrong and will be recorded again after the planned ones.

    ``outcome``: also "unusable", for a whole one without a latency.
    """

    run_id: str
    outcome: str


@dataclass(frozen=True)
class RunStarted:
    """The target moves, since ``start_s``."""

    run_id: str
    planned: PlannedRun
    start_s: float


@dataclass(frozen=True)
class RunPreviewed:
    """The run so far, soon after its target ended; not if a source is late or the run ended early."""

    run: Run
    clocks: tuple[ClockBounds, ...] = ()


@dataclass(frozen=True)
class RunFinished:
    """A saved run; ``clocks``: comparisons outside runs."""

    run: Run
    outcome: str
    clocks: tuple[ClockBounds, ...] = ()


@dataclass(frozen=True)
class SamplesArrived:
    """A digest of samples for live plots.

    Attributes:
        run_id: empty where samples are not kept.
        t_s, x_mm, y_mm: (n,) touch events; edge_s, light: (m,) edges.
        count: before decimation; rate_hz: 0 where unknown.
        age_s: of the newest sample when read, else 0.
        lost: samples lost since the session began.
        batch: the samples as read.
    """

    role: str
    run_id: str
    until_s: float
    t_s: FloatArray
    x_mm: FloatArray
    y_mm: FloatArray
    edge_s: FloatArray
    light: IntArray
    count: int
    rate_hz: float
    age_s: float
    lost: int
    batch: Batch | None = None


@dataclass(frozen=True)
class TapsArrived:
    """Taps saved, and rejected, so far."""

    down: int
    release: int
    rejected: int


@dataclass(frozen=True)
class DeviceFault:
    """A device is lost for good."""

    role: str
    address: str
    problem: str
    remedy: str


@dataclass(frozen=True)
class NoticeRaised:
    """A notice for the operator; ``source``: who noticed, as "laser", "file" or "operator"."""

    t_s: float
    level: str  # "info" | "warning" | "error"
    source: str
    text: str
    state: str = ""  # "lost" | "back" where a device went or came back


@dataclass(frozen=True)
class DiskStatus:
    """Free space, and size of the file so far."""

    free_bytes: int
    file_bytes: int


@dataclass(frozen=True)
class PlaceWanted:
    """Saving ``path`` fails; the session waits for ``Control.name_place``."""

    path: Path
    problem: str
    remedy: str


@dataclass(frozen=True)
class SessionFinished:
    """The file is closed; ``problem``: why it is not whole, else empty."""

    path: Path
    problem: str = ""


Event = (
    DeviceOpened
    | StateChanged
    | Resting
    | RunQueued
    | RunStarted
    | RunPreviewed
    | RunFinished
    | SamplesArrived
    | TapsArrived
    | DeviceFault
    | NoticeRaised
    | DiskStatus
    | PlaceWanted
    | SessionFinished
)
Listener = Callable[[Event], None]
"""Called from the session's and the writer's thread; must return quickly and never raise.

What it raises in the writer's thread goes into the log once; the recording goes on.
"""
