"""The latency is constant below a speed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from draglag.messages import message
from draglag.recording import FloatArray
from draglag.simulation.effects.base import Effect
from draglag.simulation.effects.in_fits import Parameters
from draglag.simulation.effects.parameter import Parameter
from draglag.simulation.kinematics import Kinematics
from draglag.simulation.residual import LineGains, Signature, View, column

if TYPE_CHECKING:
    from draglag.gap.fitting.joint import Fit
    from draglag.gap.fitting.model import LawParameters

SPEEDS = 8  # tried, from the slowest drags to FASTEST_MM_S
FASTEST_MM_S = 300.0
BEYOND_SLOWEST = 1.25  # it has to hold for more than the slowest run


@dataclass(frozen=True)
class LowSpeedPlateau(Effect):
    id: ClassVar[str] = "low_speed_plateau"
    title: ClassVar[str] = "low-speed plateau"
    meaning: ClassVar[str] = "Below a speed the latency no longer grows: it is held at what it is at that speed."
    follows: ClassVar[str] = "speed"
    undone_in: ClassVar[str] = "law of speed"
    refitted_by: ClassVar[str] = "draglag.simulation.effects.low_speed_plateau.refits"
    of_the_law: ClassVar[bool] = True
    form_parameter: ClassVar[str] = "plateau_mm_s"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("speed_mm_s", "mm/s", 1.0, 500.0, 125.0),)

    def law_speed(self, speed_mm_s: FloatArray, k: Kinematics) -> FloatArray:
        return np.maximum(speed_mm_s, self.value)

    @classmethod
    def signatures(cls, view: View, gains: LineGains | None = None) -> list[Signature]:
        slowest = BEYOND_SLOWEST * float(np.quantile(view.speed, 0.05))
        return [cls.signature_at((float(v),), view) for v in np.geomspace(slowest, max(FASTEST_MM_S, slowest), SPEEDS)]

    @classmethod
    def signature_at(cls, theta: tuple[float, ...], view: View) -> Signature:
        change_s = view.law(np.maximum(view.speed, theta[0])) - view.law(view.speed)
        return Signature(latency=column(change_s), theta=theta)

    @classmethod
    def in_law(cls, law: LawParameters) -> bool:
        return law.plateau_mm_s > 0

    @classmethod
    def law_parameters(cls, fit: Fit) -> Parameters:
        return {cls.parameters[0].name: (fit.law.plateau_mm_s, cls.own_module().plateau_ci95_mm_s(fit))}

    @classmethod
    def where_in(cls, fit: Fit) -> str:
        return message("drag speed below {speed:.0f} mm/s", speed=fit.law.plateau_mm_s)

    @classmethod
    def curve_speed(cls, speed_mm_s: FloatArray, parameters: Mapping[str, float]) -> FloatArray:
        return np.maximum(speed_mm_s, next(iter(parameters.values()), 0.0))
