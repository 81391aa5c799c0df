"""The operator's names of effects and parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from PySide6.QtCore import QCoreApplication

from draglag.simulation.effects import EFFECTS, title_of
from draglag.simulation.effects.parameter import Parameter, amount, ends, parameter_of
from draglag_app.windows.wording.words import between

EFFECT_NAMES = {effect: title_of(effect) for effect in EFFECTS}
PARAMETER_NAMES = {spec.in_words for effect in EFFECTS.values() for spec in effect.parameters}
_DIGITS = 3  # of a size in a headline


def _say(text: str) -> str:
    return QCoreApplication.translate("Effect", text)


def effect_name(effect: str) -> str:
    """An effect's name, translated; other texts unchanged."""
    return _say(EFFECT_NAMES[effect]) if effect in EFFECT_NAMES else effect


def effect_meaning(effect: str) -> str:
    """The effect's meaning and id."""
    known = EFFECTS.get(effect)
    return effect if known is None else f"{_say(known.meaning)} ({effect})"


def size_words(effect: str, parameter: str, value: float, interval: tuple[float, float] | None = None) -> str:
    """A parameter's name, size and 95 % interval, in the operator's unit."""
    spec = _parameter(effect, parameter)
    text = f"{_say(spec.in_words)} {amount(spec, value)}"
    return text if interval is None else f"{text} ({between(*ends(spec, interval))})"


def main_size(effect: str, parameters: Mapping[str, Any]) -> tuple[str, str]:
    """Size and interval of a step's first parameter: "24.9 ppm", "23.7 to 26.2"; or empty."""
    for parameter, given in parameters.items():
        spec = _parameter(effect, parameter)
        return amount(spec, given["value"], _DIGITS), between(*ends(spec, given["ci95"], _DIGITS))
    return "", ""


def _parameter(effect: str, parameter: str) -> Parameter:
    return parameter_of(EFFECTS[effect].parameters if effect in EFFECTS else (), parameter)
