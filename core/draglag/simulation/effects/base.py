"""Base of all effects: id, meaning, parameters, and hooks that do nothing by default."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from typing import ClassVar

import numpy as np

from draglag.errors import DataError
from draglag.messages import message
from draglag.recording import FloatArray, IntArray, Screen
from draglag.simulation.effects.in_fits import InFits, Parameters
from draglag.simulation.effects.parameter import Parameter
from draglag.simulation.kinematics import Kinematics
from draglag.simulation.residual import LineGains, Signature, View


@dataclass(frozen=True)
class TouchEvents:
    """Touch events in session time, (n,) each."""

    t_s: FloatArray
    x_mm: FloatArray
    y_mm: FloatArray
    contact_id: IntArray

    def take(self, which: IntArray | np.ndarray[tuple[int], np.dtype[np.bool_]]) -> TouchEvents:
        """Events by index or mask."""
        return TouchEvents(self.t_s[which], self.x_mm[which], self.y_mm[which], self.contact_id[which])


def each_contact(events: TouchEvents, change: Callable[[FloatArray, FloatArray], FloatArray]) -> TouchEvents:
    """Events with ``change(t_s, xy_mm)``, (n,) and (n, 2), of each contact as positions."""
    xy = np.column_stack([events.x_mm, events.y_mm])
    bounds = np.flatnonzero(np.diff(events.contact_id)) + 1
    for own in np.split(np.arange(events.t_s.size), bounds):
        if own.size:
            xy[own] = change(events.t_s[own], xy[own])
    return TouchEvents(events.t_s, xy[:, 0], xy[:, 1], events.contact_id)


@dataclass(frozen=True)
class Edges:
    """Laser edges in session time, (m,) each; light 1: the beam becomes clear."""

    t_s: FloatArray
    light: IntArray = field(default_factory=lambda: np.empty(0, np.int64))


@dataclass(frozen=True)
class Effect(InFits):
    """Base of all effects; ``value`` is the first of ``parameters``.

    Raises DataError if a parameter is out of bounds or should be whole.
    """

    id: ClassVar[str]
    meaning: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]]
    title: ClassVar[str] = ""
    """Name for people; empty: its id in words."""
    in_detail: ClassVar[str] = ""
    """How it is computed, for who writes a simulation of it."""
    follows: ClassVar[str] = ""
    """Covariate that its gap follows: speed, session_time, x, direction, kind_of_edge, acceleration, taps, frame …"""
    where: ClassVar[str] = "everywhere"
    """Where it acts, in words for the operator."""
    shares_column_of: ClassVar[str] = ""
    """Id of the effect that moves edges in the same way: edges cannot distinguish the two."""
    separated_by: ClassVar[str] = ""
    """The recording that would separate it from what looks alike, in words for the operator."""
    drags_early: ClassVar[int] = 0
    """1 where its first parameter, s, is by how much drags are shown early against taps, -1 where late; 0: neither."""
    needs: ClassVar[str] = ""
    """What a session needs to show it: "taps", "changing speed", "width" (circles that travel along the beam), "other
    stylus"; empty: nothing."""
    identifiable_with: ClassVar[str] = ""
    """The recording that would show it, in words."""
    undone_in: ClassVar[str] = ""
    """What it is taken out of: "laser" or "touch" (by the hooks below), "stream" (repaired by inspection), "law of
    speed" and "law" (part of the latency law); empty: nothing."""
    uneven_ages: ClassVar[bool] = False
    """Whether it leaves positions of uneven age, so that edges scatter in time."""
    detected_by: ClassVar[str] = ""
    """Module of its detector: ``detect(streams, runs)`` returns the effect, or None, and the repaired runs. Imported
    late: it builds on the gap."""
    detection_order: ClassVar[int] = 100
    """Order of detection: each detector gets runs in which earlier effects are repaired."""
    in_measured_streams: ClassVar[bool] = False
    """Whether a session simulated again has it already, as measured streams hold what was lost or random."""
    estimated_with: ClassVar[bool] = False
    """Whether latencies are estimated with it, though it can be repaired: programs see its delay."""
    hides_hand: ClassVar[bool] = False
    """Whether the hand behind it is recovered too badly for the latency of its simulated runs to be compared."""
    laser_late: ClassVar[bool] = False
    """Whether its first parameter, s, is a lateness common to all laser stamps."""
    removed_by_clock_comparisons: ClassVar[bool] = False
    """Whether a session's clock comparisons take it out."""
    order: ClassVar[int] = 0
    """Place in the stream of events: nearest to the glass first."""

    value: float

    def __post_init__(self) -> None:
        for spec, number in zip(self.parameters, self.numbers().values(), strict=True):
            if not spec.lower <= number <= spec.upper:
                raise DataError(
                    message(
                        "{name}: {parameter} = {value:g} is out of bounds",
                        name=self.id,
                        parameter=spec.name,
                        value=number,
                    ),
                    message(
                        "choose {lower:g} to {upper:g} {unit}, typically {typical:g}",
                        lower=spec.lower,
                        upper=spec.upper,
                        unit=spec.unit,
                        typical=spec.typical,
                    ),
                )
            if spec.whole and number != round(number):
                raise DataError(
                    message(
                        "{name}: {parameter} = {value:g} is no whole number",
                        name=self.id,
                        parameter=spec.name,
                        value=number,
                    ),
                    message("choose {value}", value=round(number)),
                )

    def numbers(self) -> dict[str, float]:
        """Parameter name → number, the size first."""
        own = [getattr(self, f.name) for f in fields(self)]
        return {spec.name: float(n) for spec, n in zip(self.parameters, own, strict=True)}

    @classmethod
    def typical(cls) -> Effect:
        """The effect at its typical size."""
        return cls(*(spec.typical for spec in cls.parameters))

    def law_speed(self, speed_mm_s: FloatArray, k: Kinematics) -> FloatArray:
        """Speed given to the latency law, (n,)."""
        return speed_mm_s

    def latency(self, latency_s: FloatArray, k: Kinematics, rng: np.random.Generator) -> FloatArray:
        """Latency, (n,)."""
        return latency_s

    def per_acceleration_s3_mm(self) -> float:
        """Latency per tangential acceleration, s per mm/s², if it grows with it: such a hand is hard to recover."""
        return 0.0

    def position(self, x_mm: FloatArray, y_mm: FloatArray, k: Kinematics) -> tuple[FloatArray, FloatArray]:
        """Reported position, (n,)."""
        return x_mm, y_mm

    def events(self, events: TouchEvents, rng: np.random.Generator) -> TouchEvents:
        """Touch events."""
        return events

    def diameter(self, diameter_mm: FloatArray, k: Kinematics) -> FloatArray:
        """Width of the shadow, (n,)."""
        return diameter_mm

    def distance(self, distance_mm: FloatArray, k: Kinematics) -> FloatArray:
        """Signed distance from the beam, (n,), positive below it."""
        return distance_mm

    def edges(self, edges: Edges, rng: np.random.Generator) -> Edges:
        """Laser edges on the host clock, in any order."""
        return edges

    def laser_clock(self, t_s: FloatArray) -> FloatArray:
        """Reading of the laser's clock at session time, (m,)."""
        return t_s

    def stamped_late_s(self) -> float:
        """Mean lateness of touch stamps, which repair leaves in."""
        return 0.0

    def true_intercept_mm(self, intercept_mm: float, slope: float, screen: Screen) -> float:
        """True intercept of the beam, from the one in reported coordinates."""
        return intercept_mm

    def longest_wait_s(self, frame_s: float) -> float:
        """Longest wait of an event; taps and drags may differ."""
        return 0.0

    def tap_latency(self, latency_s: FloatArray, t_s: FloatArray) -> FloatArray:
        """Latency of taps at session times, (n,)."""
        return latency_s

    @classmethod
    def curve_speed(cls, speed_mm_s: FloatArray, parameters: Mapping[str, float]) -> FloatArray:
        """Speed given to a law of speed, (n,), if ``undone_in`` it."""
        return speed_mm_s

    @classmethod
    def curve_extra_s(cls, speed_mm_s: FloatArray, parameters: Mapping[str, float]) -> FloatArray | float:
        """Latency added to a law of speed, (n,), if ``undone_in`` it."""
        return 0.0

    @classmethod
    def acts_on_touch(cls) -> bool:
        """Whether it changes touch events."""
        hooks = ("law_speed", "latency", "position", "events")
        return any(getattr(cls, hook) is not getattr(Effect, hook) for hook in hooks)

    @classmethod
    def first_shown_s(cls, t_s: FloatArray, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray | None:
        """Times of events before the effect, (n,); None if events do not determine them."""
        return None

    @classmethod
    def columns_at(cls, theta: tuple[float, ...], view: View) -> tuple[Signature, ...]:
        """Equally probable columns beyond a constant latency at parameters theta, for effects with ``drags_early``; may
        be empty."""
        return ()

    @classmethod
    def with_taps(cls, parameters: Parameters, value: float, ci95: tuple[float, float]) -> Parameters | None:
        """Parameters from edges and, for effects with ``drags_early``, the first from taps; None if they contradict
        each other."""
        return None

    @classmethod
    def signatures(cls, view: View, gains: LineGains | None = None) -> list[Signature]:
        """Signature at each non-linear setting; empty if edges do not show it. gains: selects among many settings."""
        return []

    @classmethod
    def signature_at(cls, theta: tuple[float, ...], view: View) -> Signature:
        """Signature of the nearest setting."""
        options = cls.signatures(view)
        if not theta:
            return options[0]
        options = [o for o in options if len(o.theta) == len(theta)]
        distance = [abs(o.theta[0] - theta[0]) + 1e3 * (o.theta[1:] != theta[1:]) for o in options]
        return options[int(np.argmin(distance))]
