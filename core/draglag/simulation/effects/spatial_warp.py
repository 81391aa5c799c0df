"""The panel's coordinates are bent."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Confounder, Effect, Parameter
from draglag.simulation.kinematics import Kinematics
from draglag.simulation.residual import LineGains, Signature, View

CYCLES = np.arange(0.5, 2.01, 0.125)  # of a sine over the panel's width
DEGREES = (2, 6)  # of polynomials: the class's own bend, and any smooth one
SHARE_OF_WAVES = 0.3  # of the prior probability


@dataclass(frozen=True)
class SpatialWarp(Effect):
    """The panel's coordinates are bent."""

    id: ClassVar[str] = "spatial_warp"
    meaning: ClassVar[str] = (
        "Reported heights are bent along the panel by a smooth quadratic: this much at its left and "
        "right edges, half of it the other way in the middle."
    )
    follows: ClassVar[str] = "x"
    where: ClassVar[str] = "along x, smoothly"
    size_is_the_term_s: ClassVar[bool] = False
    shown_apart_by: ClassVar[str] = "a second beam height: a bent panel bends there too, a curved beam moves along"
    undone_in: ClassVar[str] = "touch"
    needs: ClassVar[str] = "width"
    unseen_without: ClassVar[str] = "circles that travel across the whole width show it"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("amplitude_mm", "mm", -5.0, 5.0, 0.6),)
    confounded_with: ClassVar[tuple[Confounder, ...]] = (
        Confounder(
            "beam_wedge",
            "both change along the beam, one for the two sides alike and one for them apart",
            "none, if both kinds of edge were recorded on both sides; otherwise a longer run",
        ),
        Confounder(
            "beam_bow",
            "along one line a curved beam moves every edge as a quadratic bend of the panel's coordinates does",
            "a second beam height",
        ),
    )

    def position(self, x_mm: FloatArray, y_mm: FloatArray, k: Kinematics) -> tuple[FloatArray, FloatArray]:
        u = 2 * k.motion.x_mm / k.width_mm - 1
        return x_mm, y_mm + self.value * (1.5 * u**2 - 0.5)

    @classmethod
    def signatures(cls, view: View, gains: LineGains | None = None) -> list[Signature]:
        bends = [cls.signature_at((0.0, float(degree)), view) for degree in DEGREES]
        return [*bends, *(cls.signature_at((float(k),), view) for k in CYCLES)]

    @classmethod
    def signature_at(cls, theta: tuple[float, ...], view: View) -> Signature:
        """theta: (cycles,) of a wave over the panel, or (0, degree) of a polynomial, whose square has no mean."""
        cycles, degree = (*theta, 0.0)[:2] if theta else (0.0, max(DEGREES))
        x = view.panel_x
        if cycles > 0:
            wave = np.column_stack([np.sin(cycles * np.pi * x), np.cos(cycles * np.pi * x)])
            return Signature(offset=wave, theta=theta, share=SHARE_OF_WAVES / CYCLES.size)
        powers = np.column_stack([x**k for k in range(2, int(degree) + 1)])
        powers[:, 0] -= x.mean()
        share = (1 - SHARE_OF_WAVES) / len(DEGREES)
        return Signature(offset=powers, theta=(0.0, float(degree)), share=share)
