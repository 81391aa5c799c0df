"""The digitiser's averaging cuts corners."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.signal import filtfilt

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Confounder, Effect, Parameter
from draglag.simulation.kinematics import Kinematics
from draglag.simulation.residual import LineGains, Signature, View, column


@dataclass(frozen=True)
class SmoothingShrink(Effect):
    """The digitiser's averaging cuts corners."""

    id: ClassVar[str] = "smoothing_shrink"
    meaning: ClassVar[str] = (
        "The low-pass behind the latency also shrinks curved paths; its mean delay is part of the "
        "latency, its shrinking is this effect."
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("time_constant_s", "s", 0.0, 0.1, 0.015),)
    confounded_with: ClassVar[tuple[Confounder, ...]] = (
        Confounder(
            "scale_error",
            "at one speed and radius a shrunk circle is a scaled one",
            "circles of two radii at the same speed",
        ),
    )

    def position(self, x_mm: FloatArray, y_mm: FloatArray, k: Kinematics) -> tuple[FloatArray, FloatArray]:
        """A first-order low-pass both ways: the gain of one of the full time constant, without its delay."""
        one_way = self.value / np.sqrt(2)
        if one_way == 0:
            return x_mm, y_mm
        keep = float(np.exp(-k.step_s / one_way))
        margin = min(len(x_mm) - 1, int(10 * one_way / k.step_s) + 1)

        def smooth(p: FloatArray) -> FloatArray:
            return np.asarray(filtfilt([1 - keep], [1.0, -keep], p, padlen=margin))

        return smooth(x_mm), smooth(y_mm)

    @classmethod
    def signatures(cls, view: View, gains: LineGains | None = None) -> list[Signature]:
        # A first-order low-pass with time constant τ whose delay the law already holds leaves ½ τ² of acceleration.
        return [Signature(offset=column(0.5 * view.a_across))]
