"""Streams of the Lab Streaming Layer (extra ``lsl``).

Stamps: monotonic clock, liblsl's own on Linux. A failing stream costs a warning, never the recording.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import Any

import numpy as np

from draglag.errors import DraglagError
from draglag.messages import message
from draglag.recording import TouchTrace
from draglag.system.packages import advice
from draglag_app.session import events

TOUCH = (("x_mm", "millimeters"), ("y_mm", "millimeters"), ("contact_id", ""))
LASER = (("light", ""),)
MARKERS = (("marker", ""),)
_IRREGULAR = 0.0


@dataclass(frozen=True)
class _Outlets:
    touch: Any
    laser: Any
    markers: Any


def lsl_listener(source: str, then: events.Listener) -> events.Listener:
    """A listener that feeds three streams, and ``then``. Raises DraglagError.

    Streams: "draglag touch" (x_mm, y_mm, contact_id), "draglag laser" (light), "draglag markers" ("begin run-01
    circle", "end run-01 complete"). ``source`` identifies them after a restart.
    """
    pylsl = _library()
    outlets = _Outlets(
        _outlet(pylsl, "draglag touch", "Touch", TOUCH, pylsl.cf_double64, source),
        _outlet(pylsl, "draglag laser", "Laser", LASER, pylsl.cf_double64, source),
        _outlet(pylsl, "draglag markers", "Markers", MARKERS, pylsl.cf_string, source),
    )
    broken = False

    def listen(event: events.Event) -> None:
        nonlocal broken
        if not broken:
            try:
                _push(outlets, event)
            except Exception as error:  # whatever it is, the recording goes on
                broken = True
                text = message("the Lab Streaming Layer gets nothing any more ({error})", error=error)
                then(events.NoticeRaised(0.0, "warning", "lsl", text))
        then(event)

    return listen


def _library() -> Any:
    try:
        return importlib.import_module("pylsl")
    except ModuleNotFoundError as missing:
        raise DraglagError(*advice(missing.name or "")) from missing
    except (OSError, RuntimeError) as error:
        raise DraglagError(
            message("the library of the Lab Streaming Layer cannot be loaded ({error})", error=error),
            "Install liblsl, or omit --lsl",
        ) from error


def _outlet(pylsl: Any, name: str, kind: str, channels: tuple[tuple[str, str], ...], numbers: int, source: str) -> Any:
    info = pylsl.StreamInfo(name, kind, len(channels), _IRREGULAR, numbers, f"{source} {kind}")
    described = info.desc().append_child("channels")
    for label, unit in channels:
        channel = described.append_child("channel")
        channel.append_child_value("label", label)
        channel.append_child_value("unit", unit)
    return pylsl.StreamOutlet(info)


def _push(outlets: _Outlets, event: events.Event) -> None:
    if isinstance(event, events.SamplesArrived) and event.batch is not None:
        if event.batch.touch is not None:
            for t_s, row in zip(event.batch.touch.t_s.tolist(), _rows(event.batch.touch), strict=True):
                outlets.touch.push_sample(row, t_s)
        if event.batch.laser is not None:
            laser = event.batch.laser
            for t_s, light in zip(laser.t_s.tolist(), laser.light.tolist(), strict=True):
                outlets.laser.push_sample([float(light)], t_s)
    elif isinstance(event, events.RunStarted):
        outlets.markers.push_sample([f"begin {event.run_id} {event.planned.kind}"], event.start_s)
    elif isinstance(event, events.RunFinished):
        run = event.run
        outlets.markers.push_sample([f"end {run.id} {event.outcome}"], run.start_s + run.duration_s)


def _rows(touch: TouchTrace) -> list[list[float]]:
    contact = touch.contact_id if len(touch.contact_id) else np.full(len(touch.t_s), -1)
    rows: list[list[float]] = np.column_stack([touch.x_mm, touch.y_mm, contact]).tolist()
    return rows
