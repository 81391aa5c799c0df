"""The contact's centroid trails the tip."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Effect
from draglag.simulation.effects.parameter import Parameter
from draglag.simulation.kinematics import Kinematics


@dataclass(frozen=True)
class ContactTrail(Effect):
    id: ClassVar[str] = "contact_trail"
    meaning: ClassVar[str] = "The reported position trails the stylus by a fixed distance along its motion."
    in_detail: ClassVar[str] = (
        "It adds trail / v to the latency: an Eq. 5 takes most of a positive one, and a negative one makes "
        "the latency rise with speed."
    )
    undone_in: ClassVar[str] = "touch"
    needs: ClassVar[str] = "other stylus"
    identifiable_with: ClassVar[str] = "a fixed trail hides in the latency law: a tap or a second stylus shows it"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("trail_mm", "mm", -3.0, 3.0, 0.5),)

    def position(self, x_mm: FloatArray, y_mm: FloatArray, k: Kinematics) -> tuple[FloatArray, FloatArray]:
        # a stylus that rests has no direction: the trail fades below a few mm/s
        speed = np.hypot(k.speed_mm_s, 3.0)
        trail = self.value / speed
        return x_mm - trail * k.motion.vx_mm_s, y_mm - trail * k.motion.vy_mm_s
