"""The latency follows an older speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from draglag.path.motion import SPEED_TIMING_S
from draglag.recording import FloatArray
from draglag.simulation.effects.acceleration_lag import ACCEL_UNKNOWN
from draglag.simulation.effects.base import Effect
from draglag.simulation.effects.in_fits import FittedTerm, Theta
from draglag.simulation.effects.parameter import Parameter
from draglag.simulation.kinematics import Kinematics
from draglag.simulation.law import USUAL_LATENCY_S
from draglag.simulation.residual import LineGains, Signature, View, column

if TYPE_CHECKING:
    from draglag.gap.fitting.joint import Fit
    from draglag.gap.fitting.state import Term


LATEST_OF_SOUND_S = 0.025
"""On sound panels the law's speed is up to this late, s, being read from the last positions."""


class Setting(NamedTuple):
    """delay_s: of the law's speed; None: first order in the delay. which: 1 if the delay scales with latency /
    ``USUAL_LATENCY_S``, else 0."""

    which: float = 0.0
    delay_s: float | None = None


@dataclass(frozen=True)
class LaggingLaw(Effect):
    id: ClassVar[str] = "lagging_law"
    meaning: ClassVar[str] = (
        "The latency follows the speed the stylus had some time before, not the speed at the reported position."
    )
    follows: ClassVar[str] = "acceleration"
    where: ClassVar[str] = "where the speed changes"
    separated_by: ClassVar[str] = "a chirp or step whose speed changes quickly"
    undone_in: ClassVar[str] = "law"
    refitted_by: ClassVar[str] = "draglag.simulation.effects.lagging_law.refits"
    unsure_share: ClassVar[float] = ACCEL_UNKNOWN
    needs: ClassVar[str] = "changing speed"
    identifiable_with: ClassVar[str] = "a chirp or step whose speed changes quickly"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("delay_s", "s", -0.3, 0.3, 0.04, sound=LATEST_OF_SOUND_S),)

    def law_speed(self, speed_mm_s: FloatArray, k: Kinematics) -> FloatArray:
        t = k.motion.t_s
        return np.interp(t - self.value, t, speed_mm_s)

    @classmethod
    def signatures(cls, view: View, gains: LineGains | None = None) -> list[Signature]:
        # A speed some time ago; or (negative) one towards the present, which is a latency later than the edge's own.
        past = -view.law_slope * view.accel
        present = past * view.latency_s / USUAL_LATENCY_S
        return [Signature(latency=column(c), theta=(k,)) for k, c in enumerate((past, present))]

    @classmethod
    def signature_at(cls, theta: tuple[float, ...], view: View) -> Signature:
        """Signature of the remaining delay."""
        which, delay_s = Setting(*theta)
        if delay_s is None:
            return super().signature_at(theta, view)
        share = view.latency_s / USUAL_LATENCY_S if which else np.ones(view.latency_s.size)
        _, change = view.trace.earlier(delay_s * share)
        return Signature(latency=column(-view.law_slope * change * share), theta=theta)

    @classmethod
    def speed_delay(cls, theta: Theta) -> tuple[float, float] | None:
        which, delay_s = Setting(*theta)
        return None if delay_s is None else (which, delay_s)

    @classmethod
    def whole_sizes(cls, term: Term, fit: Fit) -> FloatArray:
        return np.array(term.sizes) + (Setting(*term.theta).delay_s or 0.0)

    @classmethod
    def size_sd(cls, found: FittedTerm) -> float:
        """Includes errors of the speed's timing and rate."""
        return float(np.hypot(found.se[0], np.hypot(SPEED_TIMING_S, ACCEL_UNKNOWN * found.sizes[0])))
