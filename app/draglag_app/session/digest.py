"""Samples cut to a run, and reduced for live plots."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np

from draglag.recording import LaserTrace, TouchTrace, empty_laser, empty_touch
from draglag_app.session.events import SamplesArrived
from draglag_devices.source import Batch

PLOT_POINTS = 200
_Trace = TypeVar("_Trace", TouchTrace, LaserTrace)


def within(trace: _Trace, from_s: float, to_s: float) -> _Trace:
    """Samples from ``from_s`` to ``to_s`` inclusive, and overlapping gaps."""
    keep = (trace.t_s >= from_s) & (trace.t_s <= to_s)
    gaps = trace.gaps_s
    if len(gaps):
        gaps = gaps[(gaps[:, 1] >= from_s) & (gaps[:, 0] <= to_s)]
    if keep.all():
        return replace(trace, gaps_s=gaps)
    changed: dict[str, Any] = {}
    for spec in fields(trace):
        value = getattr(trace, spec.name)
        if spec.name != "gaps_s" and isinstance(value, np.ndarray) and len(value) == len(keep):
            changed[spec.name] = value[keep]
    return replace(trace, gaps_s=gaps, **changed)


def digest(role: str, run_id: str, batch: Batch, lost: int) -> SamplesArrived | None:
    """A batch for live plots; None if empty."""
    touch = batch.touch if batch.touch is not None else empty_touch()
    laser = batch.laser if batch.laser is not None else empty_laser()
    count = len(touch.t_s) + len(laser.t_s)
    if count == 0 and (batch.contacts is None or not len(batch.contacts.down)):
        return None
    t_s = touch.t_s if len(touch.t_s) else laser.t_s
    span_s = float(t_s[-1] - t_s[0]) if len(t_s) else 0.0
    step = max(1, -(-len(touch.t_s) // PLOT_POINTS))
    return SamplesArrived(
        role=role,
        run_id=run_id,
        until_s=batch.until_s,
        t_s=touch.t_s[::step],
        x_mm=touch.x_mm[::step],
        y_mm=touch.y_mm[::step],
        edge_s=laser.t_s[-PLOT_POINTS:],
        light=laser.light[-PLOT_POINTS:],
        count=count,
        rate_hz=(len(t_s) - 1) / span_s if span_s > 0 else 0.0,
        age_s=batch.until_s - float(t_s[-1]) if len(t_s) else 0.0,
        lost=lost,
        batch=batch,
    )
