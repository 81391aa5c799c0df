"""Small movements are not reported."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Effect, TouchEvents, each_contact
from draglag.simulation.effects.parameter import Parameter

JUMP, BACKLASH, FUZZ = 0.0, 1.0, 2.0
KINDS = {JUMP: "jump", BACKLASH: "backlash", FUZZ: "fuzz"}


@dataclass(frozen=True)
class Deadband(Effect):
    """``kind``: 0 jump, 1 backlash, 2 fuzz (Linux' input_defuzz_abs_event, per axis)."""

    id: ClassVar[str] = "deadband"
    meaning: ClassVar[str] = (
        "Movements below a width are held back: reported at once when it is reached (kind 0), followed at half of it "
        "(1), or as the kernel's fuzz filter does (2)."
    )
    in_detail: ClassVar[str] = (
        "The width is that of the way in the plane for kinds 0 and 1, of each axis for kind 2; in kind 1 the "
        "position stays half of it behind."
    )
    follows: ClassVar[str] = "speed"
    where: ClassVar[str] = "where the stylus is slow or turns"
    separated_by: ClassVar[str] = "a slow line with turns: there a deadband stands still, a trailing contact does not"
    undone_in: ClassVar[str] = "stream"
    uneven_ages: ClassVar[bool] = True
    detected_by: ClassVar[str] = "draglag.simulation.effects.deadband.stream"
    detection_order: ClassVar[int] = 6
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("width_mm", "mm", 0.0, 3.0, 0.3),
        Parameter("kind", "1", 0.0, 2.0, 0.0, whole=True),
    )
    kind: float = JUMP

    def events(self, events: TouchEvents, rng: np.random.Generator) -> TouchEvents:
        if self.value == 0:
            return events
        act = {JUMP: _jumped, BACKLASH: _followed, FUZZ: _defuzzed}[self.kind]
        return each_contact(events, lambda t_s, xy_mm: act(xy_mm, self.value))


# Numbers of Python, one after the other: a position depends on the one before it, and an array of two costs far more.


def _jumped(xy_mm: FloatArray, width_mm: float) -> FloatArray:
    out = xy_mm.tolist()
    for i in range(1, len(out)):
        (x, y), (held_x, held_y) = out[i], out[i - 1]
        if abs(complex(x - held_x, y - held_y)) < width_mm:
            out[i] = out[i - 1]
    return np.reshape(out, xy_mm.shape)


def _followed(xy_mm: FloatArray, width_mm: float) -> FloatArray:
    out = xy_mm.tolist()
    for i in range(1, len(out)):
        (x, y), (held_x, held_y) = out[i], out[i - 1]
        off_x, off_y = x - held_x, y - held_y
        far = abs(complex(off_x, off_y))
        share = max(1 - 0.5 * width_mm / far, 0.0) if far else 0.0
        out[i] = [held_x + share * off_x, held_y + share * off_y]
    return np.reshape(out, xy_mm.shape)


def _defuzzed(xy_mm: FloatArray, fuzz_mm: float) -> FloatArray:
    axes = []
    for axis in xy_mm.T.tolist():
        held = axis[0] if axis else 0.0
        shown = []
        for at in axis:
            held += _part(abs(at - held), fuzz_mm) * (at - held)
            shown.append(held)
        axes.append(shown)
    return np.reshape(axes, xy_mm.T.shape).T


def _part(off_mm: float, fuzz_mm: float) -> float:
    """How much of a change is shown."""
    if off_mm < 0.5 * fuzz_mm:
        return 0.0
    return 0.25 if off_mm < fuzz_mm else 0.5 if off_mm < 2 * fuzz_mm else 1.0
