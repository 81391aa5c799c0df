"""The digitiser switches to another filter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Confounder, Effect, Parameter
from draglag.simulation.kinematics import Kinematics
from draglag.simulation.residual import LineGains, Signature, View, column


@dataclass(frozen=True)
class SecondFilterMode(Effect):
    """The digitiser switches to another filter."""

    id: ClassVar[str] = "second_filter_mode"
    meaning: ClassVar[str] = "Above a switching speed the digitiser uses a second filter, slower by a constant."
    follows: ClassVar[str] = "speed"
    where: ClassVar[str] = "above a threshold of speed"
    undone_in: ClassVar[str] = "law of speed"
    refitted_by: ClassVar[str] = "draglag.gap.proposing.second_filter"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("extra_s", "s", -0.05, 0.05, 0.006),
        Parameter("threshold_mm_s", "mm/s", 10.0, 2000.0, 300.0),
    )
    confounded_with: ClassVar[tuple[Confounder, ...]] = (
        Confounder(
            "curve form",
            "a step in the curve between two tested speeds fits a smoother curve as well",
            "circles at speeds close to either side of the switching speed, and a chirp",
        ),
    )

    threshold_mm_s: float = 300.0

    def latency(self, latency_s: FloatArray, k: Kinematics, rng: np.random.Generator) -> FloatArray:
        return latency_s + self.value * (k.speed_mm_s > self.threshold_mm_s)

    @classmethod
    def signatures(cls, view: View, gains: LineGains | None = None) -> list[Signature]:
        # A stronger filter above some speed, or while the stylus speeds up or slows down.
        out = []
        for kind, values in enumerate((view.speed, np.abs(view.accel))):
            limits = np.quantile(values, np.linspace(0.12, 0.88, 16))
            out += [mode(view, float(limit), float(kind)) for limit in limits]
        return out

    @classmethod
    def signature_at(cls, theta: tuple[float, ...], view: View) -> Signature:
        return mode(view, theta[0], theta[1], theta[2:]) if theta else super().signature_at(theta, view)


def mode(view: View, limit: float, kind: float, times_s: tuple[float, ...] = ()) -> Signature:
    """More latency above a speed (kind 0), above an acceleration (1), or in stretches of the session: of the stylus'
    own time (2), or of the time when the panel shows it (3)."""
    if kind >= 2:
        at_s = view.since_start_s + (view.latency_s if kind == 3 else 0.0)
        return Signature(
            latency=column(within(times_s, at_s).astype(float)),
            theta=(limit, kind, *times_s),
        )
    values = np.abs(view.accel) if kind else view.speed
    return Signature(latency=column((values > limit).astype(float)), theta=(limit, kind))


def within(times_s: tuple[float, ...], at_s: FloatArray) -> np.ndarray:
    """Whether times (m,) lie in one of the stretches from–to, given as one increasing row, s."""
    return np.asarray(np.searchsorted(np.array(times_s), at_s) % 2 == 1)
