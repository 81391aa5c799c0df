"""Recordings as sources: ``replay:FILE`` (session, exchange folder, evemu) and ``csv:FILE``."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np

from draglag.errors import DataError
from draglag.exchange.importers.evemu import read_evemu
from draglag.exchange.importers.input_log import mapping_of
from draglag.exchange.tables import line_of_row, read_table
from draglag.messages import message
from draglag.protocol.runs import PlannedRun
from draglag.protocol.targets import Tap
from draglag.reading.limits import TIME_S
from draglag.recording import (
    ClockBounds,
    FloatArray,
    LaserTrace,
    Run,
    Session,
    Taps,
    TouchTrace,
    empty_laser,
    empty_touch,
)
from draglag_devices.addresses import Address
from draglag_devices.source import ContactChanges, DeviceError, SourceInfo
from draglag_devices.stage import Stage, contact_changes
from draglag_devices.timeline import Timeline, TimelineSource

OPTIONS = ("speed", "width_mm", "height_mm", "units_per_mm", "run")
_EVEMU = (".events", ".evemu", ".events.gz", ".evemu.gz", ".event", ".event.gz")
_SESSION = (".h5", ".hdf5", ".partial")
_COLUMNS = {"touch": ("t_s", "x_mm", "y_mm"), "laser": ("t_s", "light")}


class Tape:
    """A recording played run by run, from the target's start: the run of that id, else the next."""

    def __init__(self, name: str, runs: tuple[Run, ...], taps: Taps | None = None) -> None:
        self.name = name
        self.runs = runs
        self.timelines = {"touch": Timeline(), "laser": Timeline(), "walt": Timeline()}
        self._taps = taps
        self._played: set[str] = set()

    def begin_run(self, planned: PlannedRun, start_s: float, run_id: str) -> None:
        left = [run for run in self.runs if run.id not in self._played]
        run = next((run for run in left if run.id == run_id), left[0] if left else None)
        if run is None:
            return
        self._played.add(run.id)
        shift_s = start_s - run.start_s
        touch = replace(run.touch, t_s=run.touch.t_s + shift_s, gaps_s=run.touch.gaps_s + shift_s)
        laser = replace(run.laser, t_s=run.laser.t_s + shift_s, gaps_s=run.laser.gaps_s + shift_s)
        spacing = float(np.median(np.diff(touch.t_s))) if len(touch.t_s) > 1 else 0.0
        self.timelines["touch"].add(touch=touch, contacts=contact_changes(touch, spacing))
        self.timelines["laser"].add(laser=laser)
        for bounds in run.sync:
            moved = replace(bounds, host_min_s=bounds.host_min_s + shift_s, host_max_s=bounds.host_max_s + shift_s)
            role = bounds.stream if bounds.stream in self.timelines else "laser"
            self.timelines[role].add(clock=_with_upper_bound(moved))

    def begin_taps(self, tap: Tap, start_s: float) -> None:
        """Play shocks and registered contacts."""
        taps = self._taps
        if taps is None or len(taps.physical_s) == 0:
            return
        self._taps = None
        good = np.isfinite(taps.physical_s) & np.isfinite(taps.registered_s)
        shift_s = start_s - float(taps.physical_s[good].min()) if good.any() else 0.0
        shocks_s, seen_s = taps.physical_s[good] + shift_s, taps.registered_s[good] + shift_s
        down = taps.down[good]
        order = np.argsort(shocks_s, kind="stable")
        self.timelines["walt"].add(
            taps=Taps(shocks_s[order], np.full(len(order), np.nan), np.full(len(order), -1, np.int64))
        )
        order = np.argsort(seen_s, kind="stable")
        ids = np.cumsum(down[order] == 1).astype(np.int64)
        self.timelines["touch"].add(contacts=ContactChanges(seen_s[order], ids, down[order]))

    def stop(self) -> None:
        for timeline in self.timelines.values():
            timeline.cut()


def _with_upper_bound(bounds: ClockBounds) -> ClockBounds:
    good = np.isfinite(bounds.host_max_s)
    epoch = bounds.epoch[good] if len(bounds.epoch) else bounds.epoch
    return replace(
        bounds,
        device_s=bounds.device_s[good],
        host_min_s=bounds.host_min_s[good],
        host_max_s=bounds.host_max_s[good],
        epoch=epoch,
    )


def replay_source(stage: Stage, role: str, address: Address) -> TimelineSource:
    """A source that plays a file. Raises DeviceError."""
    address.only(*OPTIONS)
    timeline = Timeline()

    def describe() -> SourceInfo:
        tape = cast(Tape, stage.player(f"{address.scheme}:{address.target}:{_shared(address, role)}",
                                       lambda: load_tape(address, role)))  # fmt: skip
        tape.timelines[role] = timeline
        axes = tape.runs[0].touch.axes if role == "touch" and tape.runs else ()
        return SourceInfo(
            address.text, role, message("recording of {name}", name=tape.name),
            message("as recorded, moved to the start of the run"), {"runs": len(tape.runs)}, axes,
        )  # fmt: skip

    return TimelineSource(address.text, role, stage.time_base, timeline, describe, map_clock=False)


def _shared(address: Address, role: str) -> str:
    return role if address.scheme == "csv" else "all"


def load_tape(address: Address, role: str) -> Tape:
    """The recording at an address. Raises DeviceError."""
    path = Path(address.target)
    if not os.path.exists(path):
        raise DeviceError(address.text, "there is no such file", "check the path")
    try:
        if address.scheme == "csv":
            return _csv_tape(path, role)
        if path.is_dir():
            from draglag.exchange import read_exchange

            return _session_tape(read_exchange(path), address)
        if path.name.lower().endswith(_SESSION):
            from draglag.store import read_session

            return _session_tape(read_session(path), address)
        if path.name.lower().endswith(_EVEMU):
            return _evemu_tape(path, address)
    except DataError as error:
        raise DeviceError(address.text, error.problem, error.remedy) from error
    raise DeviceError(
        address.text,
        "this kind of file is not known",
        "replay: takes a session (.h5, .partial), an exchange folder or an evemu recording (.events, .evemu, .gz)",
    )


def _session_tape(session: Session, address: Address) -> Tape:
    runs = session.runs
    if "run" in address.options:
        runs = tuple(run for run in runs if run.id == address.options["run"])
        if not runs:
            known = ", ".join(run.id for run in session.runs)
            raise DeviceError(
                address.text,
                message("holds no run '{run}'", run=address.options["run"]),
                message("it has {known}", known=known),
            )
    return Tape(session.name, runs, session.taps)


def _one_run(touch: TouchTrace, laser: LaserTrace) -> Run:
    both = np.concatenate([touch.t_s, laser.t_s])
    start_s = float(both.min()) if len(both) else 0.0
    duration_s = float(both.max()) - start_s if len(both) else 0.0
    return Run("run-01", "free", start_s, duration_s, touch, laser)


def _evemu_tape(path: Path, address: Address) -> Tape:
    recording = read_evemu(path)
    try:
        mapping = mapping_of(
            recording, address.number("width_mm"), address.number("height_mm"), address.number("units_per_mm")
        )
    except DataError as error:
        more = message("add ?units_per_mm=…, or ?width_mm=…&height_mm=… of the panel")
        raise DeviceError(address.text, error.problem, more) from None
    touch = recording.touch(mapping)
    return Tape(recording.name or path.name, (_one_run(touch, empty_laser()),))


def _csv_tape(path: Path, role: str) -> Tape:
    columns = read_csv(path, _COLUMNS[role])
    if role == "touch":
        t_s, x_mm, y_mm = columns
        touch = TouchTrace(t_s, x_mm, y_mm, np.zeros(len(t_s), np.int64))
        return Tape(path.name, (_one_run(touch, empty_laser()),))
    if not np.isin(columns[1], (0.0, 1.0)).all():
        raise DataError(message("{path}: light is 0 or 1", path=path), "Correct the column light")
    laser = LaserTrace(columns[0], columns[1].astype(np.int64))
    return Tape(path.name, (_one_run(empty_touch(), laser),))


def read_csv(path: Path, columns: tuple[str, ...]) -> list[FloatArray]:
    """Columns, each (n,), of a CSV file. Raises DataError."""
    table = read_table(path, columns, switches=("light",))
    wrong = ~np.isfinite(table).all(axis=1) | (np.abs(table[:, 0]) > TIME_S)
    wrong[1:] |= np.diff(table[:, 0], prepend=-np.inf)[1:] < 0
    if wrong.any():
        line = line_of_row(path, int(np.argmax(wrong)))
        raise DataError(
            message("{path}, line {line}: times must be numbers that never go back", path=path, line=line),
            "Correct or remove that line",
        )
    return [np.ascontiguousarray(column) for column in table.T]
