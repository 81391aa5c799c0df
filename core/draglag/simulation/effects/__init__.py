"""Library of effects (docs/effects.md). Modules ``refits`` and ``stream`` build on the gap and are imported late."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from draglag.errors import DataError
from draglag.messages import message
from draglag.simulation.effects.acceleration_lag import AccelerationLag
from draglag.simulation.effects.base import Edges, Effect, TouchEvents, each_contact
from draglag.simulation.effects.beam_bow import BeamBow
from draglag.simulation.effects.beam_wedge import BeamWedge
from draglag.simulation.effects.beam_width import BeamWidth
from draglag.simulation.effects.clock_drift import ClockDrift
from draglag.simulation.effects.clock_offset import ClockOffset
from draglag.simulation.effects.contact_trail import ContactTrail
from draglag.simulation.effects.deadband import Deadband
from draglag.simulation.effects.direction_asymmetry import DirectionAsymmetry
from draglag.simulation.effects.frame_batching import FrameBatching
from draglag.simulation.effects.frame_drop import FrameDrop
from draglag.simulation.effects.lagging_law import LaggingLaw
from draglag.simulation.effects.laser_bounce import LaserBounce
from draglag.simulation.effects.laser_hysteresis import LaserHysteresis
from draglag.simulation.effects.loss_of_contact import LossOfContact
from draglag.simulation.effects.low_speed_plateau import LowSpeedPlateau
from draglag.simulation.effects.other_packages import effects_of_other_packages
from draglag.simulation.effects.parameter import Parameter
from draglag.simulation.effects.pitch_ripple import PitchRipple
from draglag.simulation.effects.poll_grid import PollGrid
from draglag.simulation.effects.prediction import Prediction
from draglag.simulation.effects.sample_hold import SampleHold
from draglag.simulation.effects.scale_error import ScaleError
from draglag.simulation.effects.scan_skew import ScanSkew
from draglag.simulation.effects.second_filter_mode import SecondFilterMode
from draglag.simulation.effects.smoothing_shrink import SmoothingShrink
from draglag.simulation.effects.spatial_warp import SpatialWarp
from draglag.simulation.effects.speed_adaptive_filter import SpeedAdaptiveFilter
from draglag.simulation.effects.thermal_drift import ThermalDrift
from draglag.simulation.effects.timestamp_quantisation import TimestampQuantisation
from draglag.simulation.effects.warm_up import WarmUp

EFFECTS: dict[str, type[Effect]] = {
    effect.id: effect
    for effect in (
        ClockDrift,
        ClockOffset,
        LowSpeedPlateau,
        SampleHold,
        LaserHysteresis,
        BeamWidth,
        LaserBounce,
        SpatialWarp,
        ScaleError,
        DirectionAsymmetry,
        AccelerationLag,
        ContactTrail,
        ThermalDrift,
        FrameBatching,
        TimestampQuantisation,
        FrameDrop,
        LossOfContact,
        SecondFilterMode,
        ScanSkew,
        PitchRipple,
        SmoothingShrink,
        BeamWedge,
        LaggingLaw,
        SpeedAdaptiveFilter,
        Prediction,
        Deadband,
        WarmUp,
        BeamBow,
        PollGrid,
    )
}
"""Id → effect, in the design's order, then other packages'."""

for _effect in effects_of_other_packages(EFFECTS):
    EFFECTS[_effect.id] = _effect

__all__ = [
    "EFFECTS",
    "Edges",
    "Effect",
    "Parameter",
    "TouchEvents",
    "column_of",
    "each_contact",
    "effect_class",
    "known_effects",
    "parse_effect",
    "parse_effects",
    "title_of",
    "twins_of",
]


def effect_class(effect_id: str) -> type[Effect]:
    """Effect of that id; the inert base class if unknown."""
    return EFFECTS.get(effect_id, Effect)


def title_of(effect_id: str) -> str:
    """Name for people: "low-speed plateau"."""
    return effect_class(effect_id).title or effect_id.replace("_", " ")


def column_of(effect_id: str) -> str:
    """Id of the effect whose signature stands for this one."""
    return effect_class(effect_id).shares_column_of or effect_id


def twins_of(effect_id: str) -> tuple[str, ...]:
    """Ids of other effects that move edges alike."""
    same = column_of(effect_id)
    return tuple(other for other in EFFECTS if other != effect_id and column_of(other) == same)


def parse_effect(text: str) -> Effect:
    """Effect of ``ID=VALUE``, ``ID=VALUE,name=number,…`` or, at its typical size, ``ID``.

    Raises DataError for an unknown id or parameter, no number, or one out of bounds.
    """
    head, *others = text.split(",")
    name, equals, value = head.partition("=")
    name = name.strip()
    if name not in EFFECTS:
        raise DataError(
            message("unknown effect '{name}'", name=name),
            message("use one of {effects}", effects=", ".join(EFFECTS)),
        )
    cls = EFFECTS[name]
    numbers = {spec.name: spec.typical for spec in cls.parameters}
    main = cls.parameters[0]
    if equals:
        numbers[main.name] = _number(value, name, main)
    for other in others:
        key, _, value = other.partition("=")
        spec = next((p for p in cls.parameters if p.name == key.strip()), None)
        if spec is None:
            raise DataError(
                message("effect {name} has no parameter '{parameter}'", name=name, parameter=key.strip()),
                message("known: {names}", names=", ".join(numbers)),
            )
        numbers[spec.name] = _number(value, name, spec)
    return cls(*numbers.values())


def parse_effects(texts: Iterable[str]) -> tuple[Effect, ...]:
    """Effects, each id at most once. Raises DataError."""
    effects = tuple(parse_effect(text) for text in texts)
    ids = [effect.id for effect in effects]
    for name in ids:
        if ids.count(name) > 1:
            raise DataError(message("effect {name} is given twice", name=name), "give each effect once")
    return effects


def _number(text: str, name: str, spec: Parameter) -> float:
    try:
        return float(text)
    except ValueError as error:
        example = (
            f"{name}={spec.typical:g}"
            if spec.name == EFFECTS[name].parameters[0].name
            else f"{spec.name}={spec.typical:g}"
        )
        raise DataError(
            message(
                "'{text}' is not a number for {parameter} of effect {name}", text=text, parameter=spec.name, name=name
            ),
            message("write for example {example} ({unit})", example=example, unit=spec.unit),
        ) from error


def known_effects(ids: Collection[str] | str | None) -> frozenset[str]:
    """The ids given, or all for None. Raises DataError for an unknown one."""
    if ids is None:
        return frozenset(EFFECTS)
    wanted = frozenset((ids,) if isinstance(ids, str) else ids)
    unknown = sorted(wanted - set(EFFECTS))
    if unknown:
        raise DataError(
            message("unknown effect '{name}'", name=unknown[0]),
            message("Use one of {effects}", effects=", ".join(EFFECTS)),
        )
    return wanted
