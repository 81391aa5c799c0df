"""Position errors repeat with the electrodes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Effect, Parameter
from draglag.simulation.kinematics import Kinematics
from draglag.simulation.residual import LineGains, Signature, View

PITCHES_MM = np.geomspace(3.0, 10.0, 300)
PITCHES_TRIED = 8


@dataclass(frozen=True)
class PitchRipple(Effect):
    """Position errors repeat with the electrodes."""

    id: ClassVar[str] = "pitch_ripple"
    title: ClassVar[str] = "electrode ripple"
    meaning: ClassVar[str] = (
        "The position error is periodic in the electrode pitch: the error in each axis is a sine of "
        "the place along the other, as diamond electrodes make it."
    )
    follows: ClassVar[str] = "x"
    where: ClassVar[str] = "along the panel, periodic in the electrode pitch"
    size_is_the_term_s: ClassVar[bool] = False
    undone_in: ClassVar[str] = "touch"
    refitted_by: ClassVar[str] = "draglag.gap.proposing.ripple"
    needs: ClassVar[str] = "width"
    unseen_without: ClassVar[str] = "circles that travel across the whole width show it"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("amplitude_mm", "mm", -2.0, 2.0, 0.3),
        Parameter("pitch_mm", "mm", 1.0, 30.0, 5.0),
    )

    pitch_mm: float = 5.0

    def position(self, x_mm: FloatArray, y_mm: FloatArray, k: Kinematics) -> tuple[FloatArray, FloatArray]:
        wave = 2 * np.pi / self.pitch_mm
        x = x_mm + self.value * np.sin(wave * k.motion.y_mm)
        return x, y_mm + self.value * np.sin(wave * k.motion.x_mm)

    @classmethod
    def signatures(cls, view: View, gains: LineGains | None = None) -> list[Signature]:
        # Over a wide panel a pitch has to be right to half a percent. Those tried in earnest are the largest lines in
        # the spectrum over the edges' own x and y; those passed over have their share of the prior.
        pitches = PITCHES_MM
        if gains is not None:
            lines = np.zeros(pitches.size)
            for at_mm in (view.x_mm, view.y_mm):
                phase = 2 * np.pi * at_mm[:, None] / pitches
                lines += gains(np.stack([np.sin(phase), np.cos(phase)], axis=2).reshape(at_mm.size, -1))
            pitches = pitches[np.argsort(-lines)[:PITCHES_TRIED]]
        return [ripple(view, float(p), both) for p in pitches for both in (0.0, 1.0)]

    @classmethod
    def signature_at(cls, theta: tuple[float, ...], view: View) -> Signature:
        return ripple(view, theta[0], theta[1]) if theta else super().signature_at(theta, view)


def ripple(view: View, pitch_mm: float, both: float) -> Signature:
    """One pitch, columns alone or rows too: the lattice displaces every event, and an edge sees them averaged."""
    phase = 2 * np.pi / pitch_mm * np.column_stack([view.averaged.x_mm, view.averaged.y_mm][: 2 if both else 1])
    seen = view.averaged.rows @ np.column_stack([np.sin(phase), np.cos(phase)])
    columns = seen[:, [0, 2, 1, 3]] if both else seen  # sin and cos along x, then along y
    return Signature(offset=columns, theta=(pitch_mm, both), share=1 / (2 * PITCHES_MM.size))
