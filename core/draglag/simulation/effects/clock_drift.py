"""The laser's clock runs at another rate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Effect
from draglag.simulation.effects.parameter import Parameter
from draglag.simulation.residual import LineGains, Signature, View, column


@dataclass(frozen=True)
class ClockDrift(Effect):
    id: ClassVar[str] = "clock_drift"
    meaning: ClassVar[str] = (
        "The laser's clock runs fast against the host's by a constant rate that nobody corrected, "
        "counted from the start of the session."
    )
    in_detail: ClassVar[str] = "The laser's stamps are multiplied by 1 + drift, from the first event of the session on."
    follows: ClassVar[str] = "session_time"
    where: ClassVar[str] = "growing with session time"
    per_term: ClassVar[float] = 1e6
    separated_by: ClassVar[str] = "taps before and after the runs separate a drifting clock from a creeping latency"
    undone_in: ClassVar[str] = "laser"
    removed_by_clock_comparisons: ClassVar[bool] = True
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("drift_ppm", "ppm", -500.0, 500.0, 30.0),)

    def laser_clock(self, t_s: FloatArray) -> FloatArray:
        return t_s * (1 + self.value * 1e-6)

    @classmethod
    def signatures(cls, view: View, gains: LineGains | None = None) -> list[Signature]:
        # The laser's clock gains: its stamps lie later and the latency reads shorter. A creeping latency looks alike.
        return [Signature(latency=column(-view.since_start_s))]
