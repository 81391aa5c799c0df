"""A session as nodes of the schema."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from draglag.recording import (
    ClockBounds,
    DisplayTrace,
    LaserTrace,
    LogEntry,
    Run,
    Session,
    Taps,
    TouchCalibration,
    TouchTrace,
)
from draglag.store.schema import (
    AFFINE,
    AXES,
    CALIBRATION,
    CLOCK,
    DISPLAY,
    GAPS,
    LASER,
    LOG,
    SCHEMA,
    TAPS,
    TEXT_BYTES,
    TOUCH,
    VERSION,
    Node,
    Value,
    as_text,
    check_run_id,
    cut_text,
    encode,
    slug,
)


def gap_node(path: str, gaps_s: NDArray[Any]) -> Iterator[Node]:
    if len(gaps_s):
        yield Node(f"{path}/gaps", table=GAPS, rows={"start_s": gaps_s[:, 0], "end_s": gaps_s[:, 1]})


def touch_nodes(path: str, trace: TouchTrace) -> Iterator[Node]:
    rows = {
        "time": trace.t_s,
        "x_mm": trace.x_mm,
        "y_mm": trace.y_mm,
        "contact_id": trace.contact_id,
        "x_raw": trace.x_raw,
        "y_raw": trace.y_raw,
        "device_s": trace.device_t_s,
    }
    yield Node(path, counts={"dropped": trace.dropped}, table=TOUCH, rows=rows)
    yield from gap_node(path, trace.gaps_s)


def axes_nodes(path: str, trace: TouchTrace) -> Iterator[Node]:
    """The axes, written once."""
    if trace.axes:
        number = {
            key: np.array([getattr(axis, key) for axis in trace.axes], np.int64)
            for key in ("minimum", "maximum", "resolution", "fuzz")
        }
        names = encode(AXES.columns[0], [axis.name for axis in trace.axes])
        yield Node(f"{path}/axes", table=AXES, rows={"name": names, **number})


def laser_nodes(path: str, trace: LaserTrace) -> Iterator[Node]:
    rows = {"time": trace.t_s, "light": trace.light, "device_s": trace.device_t_s, "epoch": trace.epoch}
    yield Node(path, counts={"missed": trace.missed}, table=LASER, rows=rows)
    yield from gap_node(path, trace.gaps_s)


def display_nodes(path: str, trace: DisplayTrace) -> Iterator[Node]:
    rows = {"time": trace.t_s, "x_mm": trace.x_mm, "y_mm": trace.y_mm}
    yield Node(path, counts={"missed": trace.missed}, table=DISPLAY, rows=rows)


def clock_nodes(path: str, bounds: ClockBounds) -> Iterator[Node]:
    rows = {
        "device_s": bounds.device_s,
        "host_min_s": bounds.host_min_s,
        "host_max_s": bounds.host_max_s,
        "epoch": bounds.epoch,
    }
    yield Node(f"{path}/{slug(bounds.stream)}", {"stream": bounds.stream}, table=CLOCK, rows=rows)


def taps_nodes(taps: Taps) -> Iterator[Node]:
    rows = {"physical_s": taps.physical_s, "registered_s": taps.registered_s, "down": taps.down}
    yield Node("taps", table=TAPS, rows=rows)
    yield Node("taps/rejected", counts=taps.rejected)


def log_nodes(path: str, entries: Iterable[LogEntry]) -> Iterator[Node]:
    rows = [
        (entry.t_s, entry.level, entry.source, part, text)
        for entry in entries
        for part, text in enumerate(cut_text(entry.text, TEXT_BYTES))
    ]
    if rows:
        t_s, level, source, part, text = zip(*rows, strict=True)
        by_name = {column.name: column for column in LOG.columns}
        columns: dict[str, NDArray[Any]] = {
            "time_s": np.array(t_s, np.float64),
            "level": encode(by_name["level"], level),
            "source": encode(by_name["source"], source),
            "part": np.array(part, np.int64),
            "text": encode(by_name["text"], text),
        }
        yield Node(path, table=LOG, rows=columns)


def calibration_node(known: TouchCalibration) -> Node:
    """The calibration of the touchscreen."""
    rows = {"x_raw": known.x_raw, "y_raw": known.y_raw, "x_mm": known.x_mm, "y_mm": known.y_mm}
    affine: dict[str, Value] = {name: float(value) for name, value in zip(AFFINE, np.ravel(known.matrix), strict=True)}
    return Node(
        "calibration", {"device": known.device, "made_utc": known.made_utc, **affine}, table=CALIBRATION, rows=rows
    )


def header_nodes(session: Session) -> Iterator[Node]:
    """All that is known before the first run."""
    root: dict[str, Value] = {
        "schema": SCHEMA,
        "schema_version": VERSION,
        "name": session.name,
        "started_utc": session.started_utc,
        "clock": session.clock,
        "software": session.software,
    }
    root |= _known(seed=_seed(session.seed), started_s=_float(session.started_s))
    texts = {"protocol_toml": session.protocol_toml} if session.protocol_toml else {}
    yield Node("", root, texts=texts)
    screen = session.screen
    yield Node(
        "screen",
        {
            "name": screen.name,
            "width_mm": float(screen.width_mm),
            "height_mm": float(screen.height_mm),
            "width_px": int(screen.width_px),
            "height_px": int(screen.height_px),
        },
    )
    yield Node("stylus", {"name": session.stylus.name, "diameter_mm": float(session.stylus.diameter_mm)})
    if session.beam is not None:
        beam = session.beam
        yield Node("beam", {"slope": float(beam.slope), "intercept_mm": float(beam.intercept_mm)})
    yield Node("devices", dict(session.devices))
    if session.details:
        yield Node("details", {key: as_text(text) for key, text in session.details.items()})
    if session.calibration is not None:
        yield calibration_node(session.calibration)
    for bounds in session.clocks:
        yield from clock_nodes("clocks", bounds)
    if session.taps is not None:
        yield from taps_nodes(session.taps)
    yield from log_nodes("notes", session.notes)
    yield Node("runs")


def run_nodes(run: Run, outcome: str) -> Iterator[Node]:
    """One run and its data; ``outcome`` is "recording" while it goes on."""
    path = f"runs/{check_run_id(run.id, 'session')}"
    attrs: dict[str, Value] = {
        "protocol": run.protocol,
        "start_s": float(run.start_s),
        "duration_s": float(run.duration_s),
        "outcome": outcome,
    }
    optional = _known(
        nominal_speed_mm_s=_float(run.nominal_speed_mm_s), radius_mm=_float(run.radius_mm), seed=_seed(run.seed)
    )
    yield Node(path, {**attrs, **optional})
    yield Node(f"{path}/target", dict(run.target))
    yield from touch_nodes(f"{path}/touch", run.touch)
    yield from axes_nodes(f"{path}/touch", run.touch)
    yield from laser_nodes(f"{path}/laser", run.laser)
    if run.display is not None:
        yield from display_nodes(f"{path}/display", run.display)
    for bounds in run.sync:
        yield from clock_nodes(f"{path}/sync", bounds)
    yield from log_nodes(f"{path}/log", run.log)


def session_nodes(session: Session) -> Iterator[Node]:
    """A whole session."""
    yield from header_nodes(session)
    for run in session.runs:
        yield from run_nodes(run, run.outcome)


def distinct(nodes: Iterable[Node]) -> Iterator[Node]:
    """The nodes, with separate groups where two streams give one group name."""
    taken: set[str] = set()
    for node in nodes:
        path, number = node.path, 2
        while "stream" in node.attrs and path in taken:
            path, number = f"{node.path}-{number}", number + 1
        taken.add(path)
        yield replace(node, path=path)


def _known(**values: Value | None) -> dict[str, Value]:
    return {key: value for key, value in values.items() if value is not None}


def _float(value: float | None) -> float | None:
    return None if value is None else float(value)


def _seed(seed: int | None) -> int | str | None:
    """Seeds beyond 64 bits become text."""
    return seed if seed is None or -(2**63) <= seed < 2**63 else str(seed)
