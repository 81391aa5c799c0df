"""The digitiser's averaging cuts corners."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.signal import filtfilt, lfilter

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Confounder, Effect, Parameter
from draglag.simulation.kinematics import Kinematics
from draglag.simulation.residual import LineGains, Signature, View, column


@dataclass(frozen=True)
class SmoothingShrink(Effect):
    """The digitiser's averaging cuts corners."""

    id: ClassVar[str] = "smoothing_shrink"
    title: ClassVar[str] = "smoothing that shrinks"
    meaning: ClassVar[str] = (
        "The low-pass behind the latency also shrinks curved paths; its mean delay is part of the "
        "latency, its shrinking is this effect."
    )
    follows: ClassVar[str] = "normal_acceleration"
    where: ClassVar[str] = "where the path bends"
    size_is_the_term_s: ClassVar[bool] = False
    undone_in: ClassVar[str] = "touch"
    refitted_by: ClassVar[str] = "draglag.gap.proposing.low_pass"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("time_constant_s", "s", 0.0, 0.1, 0.015),)
    confounded_with: ClassVar[tuple[Confounder, ...]] = (
        Confounder(
            "scale_error",
            "at one speed and radius a shrunk circle is a scaled one",
            "circles of two radii at the same speed",
        ),
    )

    def longest_wait_s(self, frame_s: float) -> float:
        return 2 * self.value

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

    @classmethod
    def signature_at(cls, theta: tuple[float, ...], view: View) -> Signature:
        # theta: the time constant that the traces are freed of already.
        return Signature(offset=column(0.5 * view.a_across), theta=theta)


def behind(position_mm: FloatArray, time_constant_s: float, step_s: float) -> FloatArray:
    """A path (n,) behind a first-order low-pass that looks back only, with its delay at rest given back."""
    if time_constant_s <= 0:
        return position_mm
    keep = float(np.exp(-step_s / time_constant_s))
    late = position_mm[0] + lfilter([1 - keep], [1.0, -keep], position_mm - position_mm[0])
    t = step_s * np.arange(position_mm.size)
    return np.asarray(np.interp(t + time_constant_s, t, late))
