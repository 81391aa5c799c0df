"""Samples in order of time: one stamp that goes back would make every reader refuse the session."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np

from draglag.messages import message
from draglag.recording import LaserTrace, TouchTrace
from draglag_devices.source import Batch, Notice

# A comparison of clocks refines the map from the laser's clock to the host's: an edge just after it may be mapped so
# much before the last one. The device's own stamps, which are kept with them, are in order.
_REFINED_S = 5e-3
# Drivers report what happened up to ``until_s``; some learn of an event before they have heard from all others.
_AHEAD_S = 5.0

_Trace = TypeVar("_Trace", TouchTrace, LaserTrace)


class Order:
    """The order of one source's samples."""

    def __init__(self) -> None:
        self._last_s = -np.inf
        self._said = False

    def kept(self, batch: Batch) -> Batch:
        """The batch; samples that go back, lie ahead or have no time count as lost."""
        touch, laser = batch.touch, batch.laser
        lost = 0
        if touch is not None and len(touch.t_s):
            touch, lost = self._sorted_out(touch, batch.until_s, 0.0)
            touch = replace(touch, dropped=touch.dropped + lost)
        elif laser is not None and len(laser.t_s):
            laser, lost = self._sorted_out(laser, batch.until_s, _REFINED_S)
            laser = replace(laser, missed=laser.missed + lost)
        notices = batch.notices
        if lost and not self._said:
            self._said = True
            words = message(
                "{n} samples came with stamps that go back in time or are no times: they are left out and "
                "counted as lost, as further ones will be. Check the device.",
                n=lost,
            )
            notices = (*notices, Notice(batch.until_s, "error", words))
        return replace(batch, touch=touch, laser=laser, notices=notices)

    def _sorted_out(self, trace: _Trace, until_s: float, slack_s: float) -> tuple[_Trace, int]:
        sound = np.isfinite(trace.t_s) & (trace.t_s <= until_s + _AHEAD_S)
        reached_s = np.maximum.accumulate(np.append(self._last_s, np.where(sound, trace.t_s, -np.inf)))
        keep = sound & (trace.t_s >= reached_s[:-1] - slack_s)
        t_s = np.maximum(trace.t_s, reached_s[:-1]) if slack_s else trace.t_s
        from_s, self._last_s = self._last_s, float(reached_s[-1])
        if keep.all():
            return (replace(trace, t_s=t_s) if slack_s else trace), 0
        gap = [[from_s if np.isfinite(from_s) else until_s, until_s]]
        kept = _chosen(replace(trace, t_s=t_s), keep)
        return replace(kept, gaps_s=np.concatenate([kept.gaps_s, gap])), int((~keep).sum())


def _chosen(trace: _Trace, keep: np.ndarray[Any, Any]) -> _Trace:
    changed: dict[str, Any] = {}
    for spec in fields(trace):
        value = getattr(trace, spec.name)
        if isinstance(value, np.ndarray) and spec.name != "gaps_s" and len(value) == len(keep):
            changed[spec.name] = value[keep]
    return replace(trace, **changed)
