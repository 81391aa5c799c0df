"""The digitiser's averaging shrinks curved paths."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Effect
from draglag.simulation.effects.in_fits import Z95, FittedTerm, Parameters, Theta, Undoing
from draglag.simulation.effects.parameter import Parameter
from draglag.simulation.effects.smoothing_shrink.sharpening import Setting, Sharpening
from draglag.simulation.kinematics import Kinematics
from draglag.simulation.residual import LineGains, Signature, View, bent

if TYPE_CHECKING:
    from draglag.gap.fitting.joint import Fit
    from draglag.gap.fitting.state import Term
    from draglag.gap.traces.run_data import RunData
    from draglag.simulation.effects.fitted_shape import FittedShape

SECOND_MOMENTS = (1 / 3, 0.5, 1.0)
"""Of the square of its delay: of a long moving average, of one of five samples, and of a first-order low-pass."""


@dataclass(frozen=True)
class SmoothingShrink(Effect):
    id: ClassVar[str] = "smoothing_shrink"
    title: ClassVar[str] = "smoothing that shrinks"
    meaning: ClassVar[str] = (
        "The low-pass behind the latency also shrinks curved paths; its mean delay is part of the "
        "latency, its shrinking is this effect."
    )
    in_detail: ClassVar[str] = (
        "Simulated as a filter without delay whose gain is that of a first-order low-pass with this time "
        "constant, so that the latency of a straight line and of taps stays what the law says."
    )
    hides_hand: ClassVar[bool] = True
    follows: ClassVar[str] = "normal_acceleration"
    where: ClassVar[str] = "where the path bends"
    separated_by: ClassVar[str] = "fast circles of a small radius: a low-pass shrinks them, a clock does not"
    undone_in: ClassVar[str] = "touch"
    drags_early: ClassVar[int] = -1
    refitted_by: ClassVar[str] = "draglag.simulation.effects.smoothing_shrink.refits"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("time_constant_s", "s", 0.0, 0.1, 0.015),)

    def longest_wait_s(self, frame_s: float) -> float:
        return 2 * self.value

    def position(self, x_mm: FloatArray, y_mm: FloatArray, k: Kinematics) -> tuple[FloatArray, FloatArray]:
        """Zero-phase low-pass with the gain of the full time constant."""
        from scipy.signal import filtfilt

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
        return [bent(view, 0.5)]

    @classmethod
    def signature_at(cls, theta: Theta, view: View) -> Signature:
        return bent(view, 0.5, theta=theta)

    @classmethod
    def columns_at(cls, theta: Theta, view: View) -> tuple[Signature, ...]:
        """Half the kernel's second moment times the acceleration, for each low-pass of this delay."""
        return tuple(bent(view, 0.5 * share * theta[0], theta=theta) for share in SECOND_MOMENTS)

    @classmethod
    def with_taps(cls, parameters: Parameters, value: float, ci95: tuple[float, float]) -> Parameters | None:
        """Parameters, unless taps contradict the time constant."""
        _, (low, high) = parameters[cls.parameters[0].name]
        return parameters if low <= ci95[1] and ci95[0] <= high else None

    @classmethod
    def undoing(cls, term: Term, runs: tuple[RunData, ...]) -> tuple[Undoing | None, Term]:
        setting = Setting.of(term.theta)
        return Sharpening(setting) if setting is not None and setting.lag_s else None, term

    @classmethod
    def speed_delay(cls, theta: Theta) -> tuple[float, float] | None:
        """A time constant later behind a causal low-pass."""
        setting = Setting.of(theta)
        return None if setting is None or setting.even else (0.0, -setting.lag_s)

    @classmethod
    def whole_sizes(cls, term: Term, fit: Fit) -> FloatArray:
        setting = Setting.of(term.theta)
        return np.array(term.sizes) + (0.0 if setting is None else setting.lag_s**2)

    @classmethod
    def parameters_in(cls, found: FittedTerm) -> Parameters:
        """Time constant, whose square is the size."""
        lowest, size, highest = (found.sizes[0] + s * Z95 * found.se[0] for s in (-1, 0, 1))
        low, lag, high = (float(np.sqrt(max(square, 0.0))) for square in (lowest, size, highest))
        return {cls.parameters[0].name: (lag, (low, high))}

    @classmethod
    def shape_in(cls, term: Term, fit: Fit) -> FittedShape | None:
        """None if symmetric, as the class itself."""
        setting = Setting.of(term.theta)
        if setting is None or setting.even:
            return None
        sizes = tuple(float(size) for size in cls.whole_sizes(term, fit))
        return cls.of_shape(float(np.sqrt(sizes[0])), term.theta, sizes, 0.0)

    @classmethod
    def of_shape(cls, value: float, theta: Theta, sizes: Theta, about: float) -> FittedShape | None:
        from draglag.simulation.effects.smoothing_shrink.fitted import CausalWindow

        return CausalWindow(value, tuple(theta), tuple(sizes), about)
