"""Attributes of NeXus (https://www.nexusformat.org) that show viewers (silx view, h5web, DAWN) what to draw."""

from __future__ import annotations

from typing import Any

import numpy as np

from draglag.store.lowlevel import put_attrs

ATTRIBUTES = ("NX_class", "default", "signal", "axes", "auxiliary_signals")
CURVE = "latency_against_speed"
"""The table of a stored result that is drawn: a row per run with a latency, by speed."""
# Stream of a run → column drawn against time, and those drawn with it.
_SIGNALS = {"touch": ("y_mm", ("x_mm",)), "laser": ("light", ()), "display": ("y_mm", ("x_mm",))}


def mark(file: Any) -> None:
    """Mark every group that is not marked yet, and the default plot: latency against speed, else touches."""
    runs, analyses = file.get("runs", {}), file.get("analysis", {})
    for run in runs.values():
        if "NX_class" not in run.attrs:
            _mark_run(run)
    for result in analyses.values():
        _mark_result(result)
    drawn = [name for name in sorted(filter(str.isdecimal, analyses), key=int) if CURVE in analyses[name]]
    first = min(runs, key=lambda name: float(runs[name].attrs.get("start_s", np.inf)), default="")
    _group(file, "NXroot", "analysis" if drawn else "runs" if first else "")
    if "runs" in file:
        _group(runs, "NXentry", first)
    if "analysis" in file:
        _group(analyses, "NXentry", drawn[-1] if drawn else "")


def _mark_run(run: Any) -> None:
    _group(run, "NXsubentry", "touch" if "touch" in run else "")
    for name, (signal, more) in _SIGNALS.items():
        if name in run:
            _plot(run[name], signal, "time")
            if more:
                run[name].attrs["auxiliary_signals"] = np.array([text.encode() for text in more])


def _mark_result(result: Any) -> None:
    _group(result, "NXsubentry", CURVE if CURVE in result else "")
    if CURVE in result:
        _plot(result[CURVE], "latency_ms", "speed_mm_s")


def _group(group: Any, kind: str, default: str) -> None:
    put_attrs(group, {"NX_class": kind} | ({"default": default} if default else {}))


def _plot(group: Any, signal: str, axis: str) -> None:
    put_attrs(group, {"NX_class": "NXdata", "signal": signal, "axes": axis})
