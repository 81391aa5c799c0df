"""Checks whether the rig is ready."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from draglag.errors import DraglagError, cause
from draglag.instruments.calibration import SIZE_TOLERANCE
from draglag.instruments.clocks import PAPER_DRIFT, WARN_S, fit_clock, rate_words
from draglag.messages import message, phrase
from draglag.protocol.runs import PlannedRun
from draglag.protocol.targets import Circle
from draglag.recording import AxisInfo, ClockBounds, Screen
from draglag_devices.rig import Rig, give_panel, make_rig
from draglag_devices.source import Batch, Notice, Source, SourceInfo

State = Literal["ok", "warning", "fault"]

DISK_LOW = 200_000_000
SLOWEST_TOUCH_HZ = 50.0
_READ_S = 0.03
_STEP_S = 0.25


@dataclass(frozen=True)
class Check:
    """One check."""

    name: str
    state: State
    measured: str
    limit: str = ""
    remedy: str = ""


@dataclass
class _Observed:
    info: SourceInfo
    touches_s: list[float] = field(default_factory=list)
    edges: int = 0
    missed: int = 0
    dropped: int = 0
    clock: list[ClockBounds] = field(default_factory=list)
    notices: list[Notice] = field(default_factory=list)
    alive: bool = True

    def take(self, batch: Batch) -> None:
        if batch.touch is not None:
            self.touches_s += batch.touch.t_s.tolist()
            self.dropped += batch.touch.dropped
        if batch.laser is not None:
            self.edges += len(batch.laser.t_s)
            self.missed += batch.laser.missed
        if batch.clock is not None and len(batch.clock.device_s):
            self.clock.append(batch.clock)
        self.notices += batch.notices
        self.alive = batch.alive


def ready(checks: list[Check]) -> bool:
    """Whether no check failed."""
    return all(check.state != "fault" for check in checks)


def preflight(
    addresses: Mapping[str, str],
    screen: Screen | None = None,
    screen_name: str = "screen-1",
    watch_s: float = 3.0,
    folder: Path | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> Iterator[Check]:
    """Checks while all sources are open; faults are rows, never exceptions.

    Args:
        screen: to compare the touchscreen's size with.
        screen_name: of the simulated world.
        watch_s: longer bounds the drift of clocks more closely.
        folder: for sessions.
        on_progress: called with the fraction done.
    """
    yield _disk(folder or Path.cwd())
    opened: dict[str, tuple[Source, _Observed]] = {}
    rig, fault = _rig(addresses, screen_name)
    if rig is None:
        yield fault
        return
    try:
        if screen is not None:
            give_panel(rig.sources, screen)
        yield from _open(rig, opened)
        lost = _watch(rig, opened, watch_s, on_progress)
        for role, (_, observed) in opened.items():
            if role in lost:
                yield Check(role, "fault", lost[role].problem, remedy=lost[role].remedy)
            else:
                yield from _judge(role, observed, screen)
    finally:
        rig.stage.stop()
        for source, _ in opened.values():
            source.close()


def _rig(addresses: Mapping[str, str], screen_name: str) -> tuple[Rig | None, Check]:
    try:
        return make_rig(addresses, screen_name), Check("addresses", "ok", "")
    except DraglagError as error:
        return None, Check("addresses", "fault", error.problem, remedy=error.remedy)


def _open(rig: Rig, opened: dict[str, tuple[Source, _Observed]]) -> Iterator[Check]:
    """Faults of sources that do not open; the others go into ``opened``."""
    for source in rig.sources:
        try:
            opened[source.role] = source, _Observed(source.open())
        except DraglagError as error:
            yield Check(source.role, "fault", error.problem, remedy=error.remedy)
        except Exception as error:  # a fault of one driver is a row as well and must not hide the others
            yield Check(
                source.role,
                "fault",
                message("{address}: {error}", address=source.address, error=error),
                remedy=message("report it with this line"),
            )


def _disk(folder: Path) -> Check:
    folder = folder.absolute()
    there = next((one for one in (folder, *folder.parents) if one.exists()), folder)  # the rest is made when needed
    try:
        free = shutil.disk_usage(there).free
    except OSError as error:
        return Check(
            "disk",
            "fault",
            message("{path}: {why}", path=folder, why=cause(error)),
            remedy=message("choose another folder"),
        )
    low = free < DISK_LOW
    remedy = message("make room, or save elsewhere") if low else ""
    return Check(
        "disk",
        "fault" if low else "ok",
        message("{free:.1f} GB free", free=free / 1e9),
        f"{DISK_LOW / 1e9:.1f} GB",
        remedy,
    )


def _watch(
    rig: Rig, opened: dict[str, tuple[Source, _Observed]], watch_s: float, on_progress: Callable[[float], None] | None
) -> dict[str, DraglagError]:
    clock, lost = rig.stage.time_base, dict[str, DraglagError]()
    start_s = clock.now()
    if rig.stage.players:
        # A simulated hand draws only on request; real ones may touch the screen while it is watched.
        circle = Circle(150.0, 120.0, 40.0, 250.0, duration_s=watch_s)
        rig.stage.begin_run(PlannedRun("check", circle, 250.0, 40.0), start_s, "check")
    while len(lost) < len(opened) and clock.now() < start_s + watch_s:
        if not clock.realtime:
            clock.advance_to(clock.now() + _STEP_S)
        for role, (source, observed) in opened.items():
            if role in lost:
                continue
            try:
                observed.take(source.read(_READ_S))
            except DraglagError as error:
                lost[role] = error
        if on_progress is not None:
            on_progress(min(1.0, (clock.now() - start_s) / watch_s))
    return lost


def _judge(role: str, observed: _Observed, screen: Screen | None) -> Iterator[Check]:
    if observed.alive:
        yield Check(role, "ok", observed.info.description)
    else:
        yield Check(
            role,
            "fault",
            message("{source}: lost while it was watched", source=phrase(observed.info.description)),
            remedy=message("see the lines below"),
        )
    if role == "touch":
        yield from _touch(observed, screen)
    elif role == "laser":
        yield _edges(observed)
    if role != "touch":
        yield from _clock(role, observed)
    distinct: dict[str, Notice] = {notice.text: notice for notice in observed.notices}
    for notice in distinct.values():
        if notice.level != "info":
            yield Check(role, "fault" if notice.level == "error" else "warning", notice.text)


def _edges(observed: _Observed) -> Check:
    bad, remedy = observed.missed > 0, ""
    if bad:
        remedy = message("check the light level and the beam")
    elif not observed.edges:
        remedy = message("break the beam while checking; if you did, it misses the sensor or passes above the stylus")
    measured = message("{edges} seen, {missed} missed", edges=observed.edges, missed=observed.missed)
    return Check("laser edges", "warning" if remedy else "ok", measured, message("{n} missed", n=0), remedy)


def _touch(observed: _Observed, screen: Screen | None) -> Iterator[Check]:
    axes = observed.info.axes
    if axes and screen is not None and all(axis.resolution for axis in axes):
        yield _touch_size(axes, screen)
    for axis in axes:
        if axis.fuzz:
            yield Check("touch fuzz", "warning", f"{axis.name}: {axis.fuzz}", "0",
                        message("set it to 0 unless it is under test: it is a latency of its own"))  # fmt: skip
    if len(observed.touches_s) < 3:
        yield Check(
            "touch events", "warning", message("none"), f"≥ {SLOWEST_TOUCH_HZ:.0f} Hz", message("draw while checking")
        )
        return
    rate_hz = 1.0 / float(np.median(np.diff(observed.touches_s)))
    fast, whole = rate_hz >= SLOWEST_TOUCH_HZ, not observed.dropped
    yield Check("touch events", "ok" if fast and whole else "warning",
                message("{rate_hz:.0f} Hz, {lost} lost", rate_hz=rate_hz, lost=observed.dropped),
                message("≥ {rate_hz:.0f} Hz, {lost} lost", rate_hz=SLOWEST_TOUCH_HZ, lost=0),
                "" if fast and whole else message("close other programs; try another USB port"))  # fmt: skip


def _touch_size(axes: Sequence[AxisInfo], screen: Screen) -> Check:
    sizes = [(axis.maximum - axis.minimum + 1) / axis.resolution for axis in axes]
    off = max(abs(size / real - 1) for size, real in zip(sizes, (screen.width_mm, screen.height_mm), strict=True))
    well = off <= SIZE_TOLERANCE
    return Check("touch size", "ok" if well else "warning",
                 message("{width:.1f} × {height:.1f} mm by its resolution, {percent:.1f} % off",
                         width=sizes[0], height=sizes[1], percent=100 * off),
                 f"{100 * SIZE_TOLERANCE:.0f} %",
                 "" if well else message("measure the panel with a ruler, or calibrate"))  # fmt: skip


def _clock(role: str, observed: _Observed) -> Iterator[Check]:
    name = f"{role} clock"
    limit = f"±{1e3 * WARN_S:.2f} ms"
    clocks = []
    with suppress(DraglagError):
        clocks = list(fit_clock(observed.clock).epochs.values())
    if not clocks:
        if observed.info.clock.startswith("own") or "compared" in observed.info.clock:
            yield Check(
                name,
                "fault",
                message("never compared with the host's"),
                limit,
                message("unplug it and plug it in again"),
            )
        return
    clock = clocks[-1]
    _, width = clock.to_host(np.linspace(clock.first_s, clock.last_s, 33))
    worst = float(width.max())
    well = worst <= WARN_S
    yield Check(name, "ok" if well else "warning",
                message("±{worst:.2f} ms, {n} comparisons", worst=1e3 * worst, n=clock.n_bounds), limit,
                "" if well else message("use another USB port (USB 2, no hub) and close other programs"))  # fmt: skip
    low, high = clock.fast_interval_ppm
    limit_ppm = 1e6 * PAPER_DRIFT
    beyond = low > limit_ppm or high < -limit_ppm
    known = high - low < 2 * limit_ppm
    words = message("not determined in so short a time")
    if known:
        words = message("runs {rate} ({low:+.0f} to {high:+.0f}), {ms:.2f} ms in 60 s",
                        rate=rate_words(clock.fast_ppm), low=low, high=high, ms=0.06 * abs(clock.fast_ppm))  # fmt: skip
    remedy = message("it is corrected; let the instrument warm up") if beyond else ""
    yield Check(f"{role} drift", "warning" if beyond else "ok", words, f"±{limit_ppm:.1f} ppm", remedy)
