"""Calibration of a touchscreen."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from draglag.instruments.calibration import SIZE_TOLERANCE, AffineFit, fit_affine, target_places
from draglag.recording import AxisInfo, FloatArray, Screen, TouchCalibration, TouchTrace
from draglag_devices.source import Batch

TARGETS = 9
# A stylus that slips past the screen is no answer to a target.
SHORTEST_S = 0.15
# Of the longer axis: how far a resting stylus may wander, and how near the one before a touch is taken for a bounce.
_WANDER = 0.01
_SAME = 0.1

TOO_SHORT, SLID, SAME_PLACE, NO_UNITS = "too short", "slid", "same place", "no units"


@dataclass
class Touches:
    """One raw touch per target."""

    device: str = ""
    axes: tuple[AxisInfo, ...] = ()
    found: list[tuple[float, float]] = field(default_factory=list)
    _parts: dict[int, list[TouchTrace]] = field(default_factory=dict)

    @property
    def complete(self) -> bool:
        return len(self.found) == TARGETS

    def take(self, batch: Batch) -> list[str]:
        """For every ended touch: "" if accepted, else its fault."""
        if batch.touch is not None and len(batch.touch.t_s):
            for contact in np.unique(batch.touch.contact_id):
                self._parts.setdefault(int(contact), []).append(_only(batch.touch, int(contact)))
        if batch.contacts is None:
            return []
        ended = batch.contacts.contact_id[batch.contacts.down == 0], batch.contacts.t_s[batch.contacts.down == 0]
        answers = []
        for contact, lifted_s in zip(*ended, strict=True):
            parts = self._parts.pop(int(contact), None)
            if parts is not None and not self.complete:
                answers.append(self._judge(parts, float(lifted_s)))
        return answers

    def back(self) -> None:
        """Forget the last touch."""
        if self.found:
            self.found.pop()

    def _judge(self, parts: list[TouchTrace], lifted_s: float) -> str:
        x, y = (np.concatenate([getattr(part, name) for part in parts]) for name in ("x_raw", "y_raw"))
        if not len(x):
            return NO_UNITS
        if lifted_s - float(parts[0].t_s[0]) < SHORTEST_S:
            return TOO_SHORT
        span = max((axis.maximum - axis.minimum for axis in self.axes), default=0)
        if span and max(np.ptp(x), np.ptp(y)) > 2 * _WANDER * span:
            return SLID
        place = float(np.median(x)), float(np.median(y))
        if span and self.found and np.hypot(*np.subtract(place, self.found[-1])) < _SAME * span:
            return SAME_PLACE
        self.found.append(place)
        return ""


def _only(touch: TouchTrace, contact: int) -> TouchTrace:
    mine = touch.contact_id == contact
    raw = (touch.x_raw[mine], touch.y_raw[mine]) if len(touch.x_raw) else (touch.x_raw, touch.y_raw)
    return TouchTrace(touch.t_s[mine], touch.x_mm[mine], touch.y_mm[mine], touch.contact_id[mine], *raw)


def fit_touches(x_raw: FloatArray, y_raw: FloatArray, screen: Screen) -> AffineFit:
    """The map through touches, (9,) each. Raises DataError, EstimateError."""
    return fit_affine(x_raw, y_raw, *target_places(screen.width_mm, screen.height_mm, TARGETS))


def as_recorded(
    fit: AffineFit, x_raw: FloatArray, y_raw: FloatArray, screen: Screen, device: str, made_utc: str
) -> TouchCalibration:
    """The calibration for a session file."""
    places = target_places(screen.width_mm, screen.height_mm, TARGETS)
    return TouchCalibration(x_raw, y_raw, *places, fit.matrix, device, made_utc)


def size_mismatch(fit: AffineFit, resolution: tuple[int, ...]) -> float | None:
    """Relative difference of the panel's size and ``resolution`` (units per mm, 0 where unknown), if above 2 %."""
    if len(resolution) != 2:
        return None
    mismatches = []
    for row in fit.matrix[:, :2]:
        axis = int(np.argmax(np.abs(row)))  # turned screens report across what we call down
        if resolution[axis] > 0:
            mismatches.append(abs(float(np.hypot(*row)) * resolution[axis] - 1))
    worst = max(mismatches, default=0.0)
    return worst if worst > SIZE_TOLERANCE else None
