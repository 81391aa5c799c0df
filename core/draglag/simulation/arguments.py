"""What a simulation is asked for, checked."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import isfinite
from operator import index
from os import PathLike
from pathlib import Path
from typing import Any

from draglag.arguments import other
from draglag.errors import DataError
from draglag.messages import Message, message
from draglag.reading.limits import WHOLE_MOST
from draglag.simulation.effects import EFFECTS, Effect, known_effects, parse_effects


def preset_of(given: object, wanted: Message) -> str | Path:
    """Name of a preset or path of its file. Raises DataError."""
    if not isinstance(given, str | PathLike):
        raise other(wanted, given, message("Give its name, or the path of its TOML file"))
    return given if isinstance(given, str) else Path(given)


def effects_of(given: object) -> tuple[Effect, ...]:
    """Effects by id and size, or effects themselves. Raises DataError."""
    if isinstance(given, Mapping):
        return parse_effects(f"{name}={_size(name, value)!r}" for name, value in given.items())
    if not isinstance(given, Iterable):
        raise other(message("effects"), given, message("Give their sizes, as in effects={{name: size}}"))
    effects = tuple(given)
    if isinstance(given, str) or not all(isinstance(effect, Effect) for effect in effects):
        raise DataError("effects have no size", "Give one for each, as in effects={name: size}")
    return effects


def sized_effects(given: object, made: type) -> tuple[Any, ...]:
    """Effects of a model: (id, sizes by parameter) each, or made already, with an ``id``. Raises DataError."""
    listed = isinstance(given, Iterable) and not isinstance(given, str | Mapping)
    items: tuple[object, ...] = tuple(given) if listed else (None,)  # type: ignore[arg-type]
    for item in items:
        if isinstance(item, made):
            known_effects(item.id)  # type: ignore[attr-defined]
        elif not (isinstance(item, tuple | list) and [*map(type, item)][:1] == [str] and _has_sizes(item)):
            raise DataError("effects have no size", "Give each with its sizes, as in effects=[(id, {name: size})]")
    return items


def _has_sizes(item: Sequence[Any]) -> bool:
    """Whether it is an id and numbers for it. Raises DataError for an unknown id, and for no number."""
    if len(item) != 2 or not isinstance(item[1], Mapping):
        return False
    known_effects(item[0])
    for value in item[1].values():
        if not isfinite(_size(item[0], value)):
            raise _no_number(item[0], value)
    specs = EFFECTS[item[0]].parameters
    return not specs or any(spec.name in item[1] for spec in specs)


def seed_of(given: object) -> int:
    """A whole number from 0 on. Raises DataError."""
    try:
        seed = index(given)  # type: ignore[arg-type]
    except TypeError:
        seed = -1
    if not 0 <= seed <= WHOLE_MOST:
        raise DataError(message("{seed} is no seed", seed=repr(given)), "Give a whole number from 0 on")
    return seed


def _size(effect: object, value: object) -> float:
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise _no_number(effect, value) from None


def _no_number(effect: object, value: object) -> DataError:
    problem = message("effect {effect}: {value} is not a number", effect=effect, value=repr(value))
    return DataError(problem, "Give its size as a number")
