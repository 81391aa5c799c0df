"""Small movements are not reported."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Confounder, Effect, Parameter, TouchEvents, each_contact
from draglag.simulation.residual import Signature, View, column

JUMP, BACKLASH, FUZZ = 0.0, 1.0, 2.0
KINDS = {JUMP: "jump", BACKLASH: "backlash", FUZZ: "fuzz"}


@dataclass(frozen=True)
class Deadband(Effect):
    """Small movements are not reported.

    ``kind``: 0 jump (nothing until the width, then all of it), 1 backlash (play of the width, which the position
    follows at half of it), 2 fuzz (the three zones of Linux' input_defuzz_abs_event, each axis by itself).
    """

    id: ClassVar[str] = "deadband"
    meaning: ClassVar[str] = (
        "Movements below a width are held back: reported at once when it is reached (kind 0), followed at half of it "
        "(1), or as the kernel's fuzz filter does (2)."
    )
    follows: ClassVar[str] = "speed"
    where: ClassVar[str] = "where the stylus is slow or turns"
    separated_by: ClassVar[str] = "a slow line with turns: there a deadband stands still, a trailing contact does not"
    undone_in: ClassVar[str] = "stream"
    detected_by: ClassVar[str] = "draglag.simulation.effects.deadband.stream"
    detection_order: ClassVar[int] = 6
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("width_mm", "mm", 0.0, 3.0, 0.3),
        Parameter("kind", "1", 0.0, 2.0, 0.0, whole=True),
    )
    confounded_with: ClassVar[tuple[Confounder, ...]] = (
        Confounder(
            "contact_trail",
            "along a line a position that stays behind by half of a play is one that trails by a fixed distance",
            "slow runs that turn: there the play shows",
        ),
        Confounder(
            "curve form",
            "a fixed distance is a latency of distance over speed, which the curve absorbs",
            "slow runs that turn: there the play shows",
        ),
        Confounder(
            "loss_of_contact",
            "both leave stretches without new positions",
            "none: a lost contact comes at every speed, a deadband where the stylus is slow",
        ),
    )
    settings: ClassVar[tuple[tuple[float, ...], ...]] = tuple(
        (width, kind) for kind in (JUMP, BACKLASH, FUZZ) for width in (0.1, 0.2, 0.3, 0.5)
    )

    kind: float = JUMP

    def events(self, events: TouchEvents, rng: np.random.Generator) -> TouchEvents:
        if self.value == 0:
            return events
        act = {JUMP: _jumped, BACKLASH: _followed, FUZZ: _defuzzed}[self.kind]
        return each_contact(events, lambda t_s, xy_mm: act(xy_mm, self.value))

    @classmethod
    def undo(cls, t_s: FloatArray, xy_mm: FloatArray, theta: tuple[float, ...]) -> FloatArray:
        """Exact where the position moved, in time between those places where it stood still (within the width)."""
        width_mm, kind = (*theta, JUMP)[:2]
        if xy_mm.shape[0] < 2 or width_mm <= 0:
            return xy_mm
        step = np.diff(xy_mm, axis=0, prepend=xy_mm[:1])
        if kind == FUZZ:
            return np.column_stack([_fuzzed(t_s, xy_mm[:, k], step[:, k], width_mm) for k in range(2)])
        length = np.hypot(step[:, 0], step[:, 1])
        moved = length > 0
        moved[0] = True
        before = xy_mm.copy()
        if kind == BACKLASH:
            before[moved] += 0.5 * width_mm * step[moved] / np.maximum(length[moved], 1e-12)[:, None]
        return np.column_stack([np.interp(t_s, t_s[moved], before[moved, k]) for k in range(2)])

    @classmethod
    def columns_at(cls, theta: tuple[float, ...], view: View) -> Signature:
        """Half a width behind along the motion, a latency that falls with the speed."""
        return Signature(latency=column(0.5 / view.speed), theta=theta)


def _jumped(xy_mm: FloatArray, width_mm: float) -> FloatArray:
    """Nothing until the width, then all of it."""
    out = xy_mm.copy()
    for i in range(1, len(out)):
        if np.hypot(*(xy_mm[i] - out[i - 1])) < width_mm:
            out[i] = out[i - 1]
    return out


def _followed(xy_mm: FloatArray, width_mm: float) -> FloatArray:
    """A disc of this diameter that the stylus drags along."""
    out = xy_mm.copy()
    for i in range(1, len(out)):
        off = xy_mm[i] - out[i - 1]
        far = float(np.hypot(*off))
        out[i] = out[i - 1] + (max(1 - 0.5 * width_mm / far, 0.0) * off if far else 0.0)
    return out


def _defuzzed(xy_mm: FloatArray, fuzz_mm: float) -> FloatArray:
    """Per axis: below half the fuzz nothing, below the fuzz a quarter, below twice the fuzz half, else all of it."""
    out = xy_mm.copy()
    for i in range(1, len(out)):
        off = xy_mm[i] - out[i - 1]
        out[i] = out[i - 1] + np.select([abs(off) < 0.5 * fuzz_mm, abs(off) < fuzz_mm, abs(off) < 2 * fuzz_mm],
                                        [0.0, 0.25 * off, 0.5 * off], off)  # fmt: skip
    return out


def _fuzzed(t_s: FloatArray, shown_mm: FloatArray, step_mm: FloatArray, fuzz_mm: float) -> FloatArray:
    """One axis before the fuzz filter: its zones map to steps of an eighth to a quarter, a half to one, and two."""
    size = np.abs(step_mm) / fuzz_mm
    times = np.select([size < np.sqrt(1 / 8), size < np.sqrt(2)], [4.0, 2.0], 1.0)
    before = shown_mm + (times - 1) * step_mm
    moved = step_mm != 0
    moved[0] = True
    return np.asarray(np.interp(t_s, t_s[moved], before[moved]))
