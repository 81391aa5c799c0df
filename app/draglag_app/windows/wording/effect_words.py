"""The operator's names of effects and parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from PySide6.QtCore import QCoreApplication

from draglag.simulation.effects import EFFECTS, title_of
from draglag_app.windows.wording.i18n import QT_TRANSLATE_NOOP
from draglag_app.windows.wording.words import between

EFFECT_NAMES = {effect: title_of(effect) for effect in EFFECTS}
# id → name, unit as shown, how many of it make one of the library's.
_MS = (" ms", 1e3)
PARAMETERS: dict[str, tuple[str, str, float]] = {
    "drift_ppm": (QT_TRANSLATE_NOOP("Effect", "drift"), " ppm", 1.0),
    "offset_s": (QT_TRANSLATE_NOOP("Effect", "offset"), *_MS),
    "speed_mm_s": (QT_TRANSLATE_NOOP("Effect", "speed"), " mm/s", 1.0),
    "rate_hz": (QT_TRANSLATE_NOOP("Effect", "rate"), " Hz", 1.0),
    "delay_s": (QT_TRANSLATE_NOOP("Effect", "delay"), *_MS),
    "extra_mm": (QT_TRANSLATE_NOOP("Effect", "extra"), " mm", 1.0),
    "extra_s": (QT_TRANSLATE_NOOP("Effect", "extra"), *_MS),
    "share": (QT_TRANSLATE_NOOP("Effect", "share"), " %", 100.0),
    "span_s": (QT_TRANSLATE_NOOP("Effect", "span"), *_MS),
    "amplitude_mm": (QT_TRANSLATE_NOOP("Effect", "amplitude"), " mm", 1.0),
    "difference_s": (QT_TRANSLATE_NOOP("Effect", "difference"), *_MS),
    "lag_s_per_mm_s2": (QT_TRANSLATE_NOOP("Effect", "lag"), " ms/(m/s²)", 1e6),
    "trail_mm": (QT_TRANSLATE_NOOP("Effect", "trail"), " mm", 1.0),
    "creep_s_per_h": (QT_TRANSLATE_NOOP("Effect", "creep"), " ms/h", 1e3),
    "frames": (QT_TRANSLATE_NOOP("Effect", "frames"), "", 1.0),
    "quantum_s": (QT_TRANSLATE_NOOP("Effect", "quantum"), *_MS),
    "losses_per_min": (QT_TRANSLATE_NOOP("Effect", "losses"), " /min", 1.0),
    "duration_s": (QT_TRANSLATE_NOOP("Effect", "duration"), *_MS),
    "filled": (QT_TRANSLATE_NOOP("Effect", "filled"), "", 1.0),
    "threshold_mm_s": (QT_TRANSLATE_NOOP("Effect", "threshold"), " mm/s", 1.0),
    "threshold_mm_s2": (QT_TRANSLATE_NOOP("Effect", "threshold"), " mm/s²", 1.0),
    "across_s": (QT_TRANSLATE_NOOP("Effect", "across the panel"), *_MS),
    "across_mm": (QT_TRANSLATE_NOOP("Effect", "across the panel"), " mm", 1.0),
    "pitch_mm": (QT_TRANSLATE_NOOP("Effect", "pitch"), " mm", 1.0),
    "amplitude_s": (QT_TRANSLATE_NOOP("Effect", "amplitude"), *_MS),
    "bow_mm": (QT_TRANSLATE_NOOP("Effect", "bow"), " mm", 1.0),
    "horizon_s": (QT_TRANSLATE_NOOP("Effect", "horizon"), *_MS),
    "window_s": (QT_TRANSLATE_NOOP("Effect", "window"), *_MS),
    "width_mm": (QT_TRANSLATE_NOOP("Effect", "width"), " mm", 1.0),
    "kind": (QT_TRANSLATE_NOOP("Effect", "kind"), "", 1.0),
    "fmin_hz": (QT_TRANSLATE_NOOP("Effect", "lowest cut-off"), " Hz", 1.0),
    "beta_per_mm": (QT_TRANSLATE_NOOP("Effect", "rise of the cut-off"), " Hz/(mm/s)", 1.0),
    "period_s": (QT_TRANSLATE_NOOP("Effect", "period"), *_MS),
    "jitter_s": (QT_TRANSLATE_NOOP("Effect", "jitter"), " µs", 1e6),
    "time_constant_s": (QT_TRANSLATE_NOOP("Effect", "time constant"), *_MS),
}


def _shown_as(parameter: str) -> tuple[str, str, float]:
    if parameter in PARAMETERS:
        return PARAMETERS[parameter]
    for ending, shown in (("_mm_s", (" mm/s", 1.0)), ("_s", _MS), ("_mm", (" mm", 1.0)), ("_hz", (" Hz", 1.0))):
        if parameter.endswith(ending):
            return parameter.removesuffix(ending).replace("_", " "), *shown
    return parameter.replace("_", " "), "", 1.0


def _say(text: str) -> str:
    return QCoreApplication.translate("Effect", text)


def effect_name(effect: str) -> str:
    """An effect's name, translated; other texts unchanged."""
    return _say(EFFECT_NAMES[effect]) if effect in EFFECT_NAMES else effect


def effect_meaning(effect: str) -> str:
    """The effect's meaning and id."""
    known = EFFECTS.get(effect)
    return effect if known is None else f"{_say(known.meaning)} ({effect})"


def size_words(parameter: str, value: float, interval: tuple[float, float] | None = None) -> str:
    """A parameter's name, size and 95 % interval, in the operator's unit."""
    name, unit, factor = _shown_as(parameter)
    text = f"{_say(name)} {factor * value:.4g}{unit}"
    if interval is None:
        return text
    return text + f" ({between(f'{factor * interval[0]:.4g}', f'{factor * interval[1]:.4g}')})"


def main_size(parameters: Mapping[str, Any]) -> tuple[str, str]:
    """Size and interval of a step's first parameter: "24.9 ppm", "23.7 to 26.2"; or empty."""
    for parameter, given in parameters.items():
        _, unit, factor = _shown_as(parameter)
        low, high = given["ci95"]
        return f"{factor * given['value']:.3g}{unit}", between(f"{factor * low:.3g}", f"{factor * high:.3g}")
    return "", ""
