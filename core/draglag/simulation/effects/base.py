"""What an effect is: one named physical cause of disagreement between a rig and its model.

An effect is a frozen dataclass with an id, one sentence of meaning, its parameters with units and bounds, and the
hooks of the chain it acts on. Every hook does nothing unless an effect says otherwise, so effects compose.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from typing import ClassVar

import numpy as np

from draglag.errors import DataError
from draglag.messages import message
from draglag.recording import FloatArray, IntArray, Screen
from draglag.simulation.effects.in_fits import InFits, Parameters
from draglag.simulation.kinematics import Kinematics
from draglag.simulation.residual import LineGains, Signature, View


@dataclass(frozen=True)
class Parameter:
    """A number an effect has. ``name`` carries the unit of code, ``unit`` is for people.

    sound: up to this size, either way, sound rigs have it: not the effect.
    """

    name: str
    unit: str
    lower: float
    upper: float
    typical: float
    whole: bool = False
    sound: float = 0.0


@dataclass(frozen=True)
class Confounder:
    """Another explanation (an effect's id, or words) of the same data, and the recording that would separate them."""

    effect_id: str
    why: str
    extra_run: str


@dataclass(frozen=True)
class TouchEvents:
    """Touch events in session time: stamp, position and contact, (n,) each."""

    t_s: FloatArray
    x_mm: FloatArray
    y_mm: FloatArray
    contact_id: IntArray

    def take(self, which: IntArray | np.ndarray[tuple[int], np.dtype[np.bool_]]) -> TouchEvents:
        """Those events, by index or mask."""
        return TouchEvents(self.t_s[which], self.x_mm[which], self.y_mm[which], self.contact_id[which])


def each_contact(events: TouchEvents, change: Callable[[FloatArray, FloatArray], FloatArray]) -> TouchEvents:
    """Events whose positions are ``change(t_s, xy_mm)`` of each contact by itself, (n,) and (n, 2)."""
    xy = np.column_stack([events.x_mm, events.y_mm])
    bounds = np.flatnonzero(np.diff(events.contact_id)) + 1
    for own in np.split(np.arange(events.t_s.size), bounds):
        if own.size:
            xy[own] = change(events.t_s[own], xy[own])
    return TouchEvents(events.t_s, xy[:, 0], xy[:, 1], events.contact_id)


@dataclass(frozen=True)
class Edges:
    """Edges of the laser sensor in session time, (m,) each; light 1 = the beam reaches the sensor from here on."""

    t_s: FloatArray
    light: IntArray = field(default_factory=lambda: np.empty(0, np.int64))


@dataclass(frozen=True)
class Effect(InFits):
    """Base of all effects. ``value`` is the size of the effect: the first of ``parameters``.

    Raises DataError when a parameter is out of its bounds.
    """

    id: ClassVar[str]
    meaning: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]]
    confounded_with: ClassVar[tuple[Confounder, ...]] = ()
    title: ClassVar[str] = ""
    """Name for people; empty: its id in words."""
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
    """What a session must have to show it: "taps", "changing speed", "width" (circles that travel along the beam),
    "other stylus"; empty: any session."""
    identifiable_with: ClassVar[str] = ""
    """In words, the recording that would show it."""
    undone_in: ClassVar[str] = ""
    """What it is taken out of: "laser" or "touch" (by the hooks below), "stream" (repaired by inspection), "law of
    speed" and "law" (it is part of the latency law); empty where nothing undoes it."""
    looks_like: ClassVar[tuple[str, ...]] = ()
    """Covariates of structure without a name for which its refit is worth trying: columns show it badly there."""
    uneven_ages: ClassVar[bool] = False
    """Whether it leaves positions of uneven age behind, so that edges scatter in time."""
    detected_by: ClassVar[str] = ""
    """Module of its detector: ``detect(streams, runs)`` returns the effect, or None, and the runs with it repaired.
    Imported late, for it builds on the gap."""
    detection_order: ClassVar[int] = 100
    """Order of detection in the streams: each detector gets runs in which the effects before it are repaired."""
    in_measured_streams: ClassVar[bool] = False
    """Whether a session simulated again has it already: what was lost, or random, is in the measured streams."""
    estimated_with: ClassVar[bool] = False
    """Whether latencies are estimated with it in the stream of events, though it can be repaired there: its delay is
    part of what a program sees."""
    laser_late: ClassVar[bool] = False
    """Whether its first parameter, s, is by how much the laser's edges are stamped late, all alike."""
    removed_by_clock_comparisons: ClassVar[bool] = False
    """Whether a session's own comparisons of the clocks take it out."""
    order: ClassVar[int] = 0
    """Place in the stream of events: what happens nearer to the glass comes first."""

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
        """Parameter name → number, the size of the effect first."""
        own = [getattr(self, f.name) for f in fields(self)]
        return {spec.name: float(n) for spec, n in zip(self.parameters, own, strict=True)}

    @classmethod
    def typical(cls) -> Effect:
        """The effect at its typical size."""
        return cls(*(spec.typical for spec in cls.parameters))

    def law_speed(self, speed_mm_s: FloatArray, k: Kinematics) -> FloatArray:
        """(n,) the speed that the latency law is given, from the one it would be given."""
        return speed_mm_s

    def latency(self, latency_s: FloatArray, k: Kinematics, rng: np.random.Generator) -> FloatArray:
        """(n,) latency of every point of the motion, from what it would be."""
        return latency_s

    def position(self, x_mm: FloatArray, y_mm: FloatArray, k: Kinematics) -> tuple[FloatArray, FloatArray]:
        """(n,) where the digitiser believes every point of the motion is."""
        return x_mm, y_mm

    def events(self, events: TouchEvents, rng: np.random.Generator) -> TouchEvents:
        """The stream of touch events."""
        return events

    def diameter(self, diameter_mm: FloatArray, k: Kinematics) -> FloatArray:
        """(n,) width of the stylus's shadow at every point of the motion."""
        return diameter_mm

    def distance(self, distance_mm: FloatArray, k: Kinematics) -> FloatArray:
        """(n,) signed distance of every point of the motion from the beam, positive below it."""
        return distance_mm

    def edges(self, edges: Edges, rng: np.random.Generator) -> Edges:
        """The stream of laser edges, by the host's clock; the order in time need not be kept."""
        return edges

    def laser_clock(self, t_s: FloatArray) -> FloatArray:
        """(m,) what the laser's clock, believed to follow the host's, shows at session time t."""
        return t_s

    def stamped_late_s(self) -> float:
        """By how much it stamps touch events late on the average, s, which repaired stamps do not show."""
        return 0.0

    def true_intercept_mm(self, intercept_mm: float, slope: float, screen: Screen) -> float:
        """Intercept of the beam in the world, from that in the coordinates of a screen with the effect."""
        return intercept_mm

    def longest_wait_s(self, frame_s: float) -> float:
        """How long an event may wait at most, s, from one every ``frame_s``: taps and drags need not wait alike."""
        return 0.0

    def tap_latency(self, latency_s: FloatArray, t_s: FloatArray) -> FloatArray:
        """(n,) latency of taps made at session time t."""
        return latency_s

    @classmethod
    def curve_speed(cls, speed_mm_s: FloatArray, parameters: Mapping[str, float]) -> FloatArray:
        """(n,) the speed that a law of speed is given, from the one it would be given, for effects ``undone_in`` it."""
        return speed_mm_s

    @classmethod
    def curve_extra_s(cls, speed_mm_s: FloatArray, parameters: Mapping[str, float]) -> FloatArray | float:
        """(n,) what is added to the latency of a law of speed at each speed, s, for effects ``undone_in`` it."""
        return 0.0

    @classmethod
    def acts_on_touch(cls) -> bool:
        """Whether it changes anything of the touch events."""
        hooks = ("law_speed", "latency", "position", "events")
        return any(getattr(cls, hook) is not getattr(Effect, hook) for hook in hooks)

    @classmethod
    def first_shown_s(cls, t_s: FloatArray, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray | None:
        """Times (n,) of events before the effect, from the events alone; None where they do not determine them."""
        return None

    @classmethod
    def columns_at(cls, theta: tuple[float, ...], view: View) -> tuple[Signature, ...]:
        """What it moves beyond a constant latency at a known size, theta its parameters, for effects with
        ``drags_early``: alternatives that are as probable; empty where it moves no edge."""
        return ()

    @classmethod
    def with_taps(cls, parameters: Parameters, value: float, ci95: tuple[float, float]) -> Parameters | None:
        """Its parameters by the edges once taps show its first, with 95 % interval, for effects with ``drags_early``;
        None where the two contradict each other."""
        return None

    @classmethod
    def signatures(cls, view: View, gains: LineGains | None = None) -> list[Signature]:
        """How the effect moves the residual of each edge, at every setting of what it is not linear in.

        Empty where residuals do not show it. ``gains`` selects which of many settings to compute.
        """
        return []

    @classmethod
    def signature_at(cls, theta: tuple[float, ...], view: View) -> Signature:
        """The signature at a setting: the nearest of those there are."""
        options = cls.signatures(view)
        if not theta:
            return options[0]
        options = [o for o in options if len(o.theta) == len(theta)]
        distance = [abs(o.theta[0] - theta[0]) + 1e3 * (o.theta[1:] != theta[1:]) for o in options]
        return options[int(np.argmin(distance))]
