"""A gap report's sentences; empty where there is nothing to say."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import Any

from PySide6.QtCore import QCoreApplication

from draglag.gap.constants import PROBABLE, SIZE_OF_INTEREST_MM
from draglag.gap.results import BY_TAPS, UNEXPLAINED, stated
from draglag.gap.wording import LEAST_MISS_S, NOISE, also_possible, not_in_model
from draglag_app.windows.wording.effect_words import effect_name, main_size
from draglag_app.windows.wording.i18n import QT_TRANSLATE_NOOP

_FOLLOWS = {
    "speed": QT_TRANSLATE_NOOP("Gap", "the drag speed"),
    "session_time": QT_TRANSLATE_NOOP("Gap", "the session time"),
    "x": QT_TRANSLATE_NOOP("Gap", "the place along x"),
    "time_in_run": QT_TRANSLATE_NOOP("Gap", "the time in the run"),
    "acceleration": QT_TRANSLATE_NOOP("Gap", "the acceleration"),
    "normal_acceleration": QT_TRANSLATE_NOOP("Gap", "the normal acceleration"),
    "kind_of_edge": QT_TRANSLATE_NOOP("Gap", "the kind of edge"),
    "direction": QT_TRANSLATE_NOOP("Gap", "the direction of travel"),
    "direction_angle": QT_TRANSLATE_NOOP("Gap", "the direction of travel"),
    "taps": QT_TRANSLATE_NOOP("Gap", "the taps"),
    "host_tick": QT_TRANSLATE_NOOP("Gap", "the ticks of the host"),
    "frame": QT_TRANSLATE_NOOP("Gap", "the frames of the panel"),
    "turn": QT_TRANSLATE_NOOP("Gap", "the way round of the circle"),
    "run": QT_TRANSLATE_NOOP("Gap", "the run, by more than panels differ from one to the next"),
}


def followed(covariate: str) -> str:
    """What a gap follows: a covariate or an effect."""
    return QCoreApplication.translate("Gap", _FOLLOWS[covariate]) if covariate in _FOLLOWS else effect_name(covariate)


def headline(report: dict[str, Any]) -> str:
    """The verdict: causes, sizes, probabilities, gap."""
    sizes = {"last": f"{report['gap_last_mm']:.2f}", "floor": f"{report['noise_floor_mm']:.2f}"}
    verdict, more = str(report["verdict"]), bool(report.get("tolerated"))
    out = _causes(report, sizes)
    if verdict == "no_gap":
        words = _NO_GAP_BUT if more else _NO_GAP
        out.append(_say(words).format(sure=_sure_of(report, ()), **sizes))
    elif verdict == "explained" and more:
        out.append(_say(_TOO_SMALL))
    elif verdict == "unexplained":
        by = str(report.get("unexplained_by"))
        left_out = None if by == "scatter" else not_in_model(_explanations(report), _steps(report))
        words = _say(_LEFT_OUT if left_out else _SCATTER if by == "scatter" else _REMAINS)
        sure = _sure(left_out[1]) if left_out else _sure_of(report, UNEXPLAINED)
        out.append(words.format(sure=sure, covariate=followed(by), names=set_words(left_out[0]) if left_out else ""))
    return " ".join(out)


def law_words(report: dict[str, Any]) -> str:
    """That the curve is not Eq. 5, and by how much."""
    law = report.get("law") or {"adequate": True}
    if law["adequate"]:
        return ""
    words = _say(_OTHER_LAW if 1e-3 * law["misses_ms"] > LEAST_MISS_S else _OTHER_LAW_ALONE)
    return words.format(ms=f"{law['misses_ms']:.2g}", p=stated(law["probability_other"]))


def tolerated_words(report: dict[str, Any]) -> str:
    """Structure beyond chance too small to matter."""
    items = [f"{followed(item['follows'])}, {item['size_mm']:.2f} mm" for item in report.get("tolerated", ())]
    return _say(_TOLERATED).format(items="; ".join(items)) if items else ""


def noise_words(report: dict[str, Any]) -> str:
    """What the noise is made of."""
    parts = [part for part in report.get("noise", ()) if part["size_mm"] >= SIZE_OF_INTEREST_MM]
    items = [f"{_say(NOISE[part['name']])} {part['size_mm']:.2f} mm" for part in parts]
    return _say(_NOISE).format(items=", ".join(items)) if items else ""


def set_words(names: Sequence[str]) -> str:
    """A set of effects: "clock drift and beam bow", "no effect", or "something without a name"."""
    if tuple(names) == UNEXPLAINED:
        return _say(_NAMELESS)
    if not names:
        return _say(_NO_EFFECT)
    shown = [effect_name(name) for name in names]
    return _say(_AND).format(some=", ".join(shown[:-1]), last=shown[-1]) if shown[1:] else shown[0]


def compared_words(report: dict[str, Any]) -> str:
    """Explanations that share 95 % of the probability, a line each."""
    return "\n".join(f"{stated(p)}  {set_words(names)}" for names, p in _explanations(report))


def also_words(report: dict[str, Any]) -> str:
    """Other explanations that share the probability."""
    sets = [f"{set_words(names)}{_sure(p)}" for names, p in also_possible(_explanations(report), _steps(report))]
    return _say(_ALSO).format(sets=", ".join(sets)) if sets else ""


def _steps(report: dict[str, Any]) -> list[tuple[str, ...]]:
    """Each an effect and its rivals."""
    return [(step["effect"], *(step.get("indistinguishable_from") or ())) for step in report["steps"]]


def _explanations(report: dict[str, Any]) -> list[tuple[tuple[str, ...], float]]:
    return [(tuple(item["effects"]), item["probability"]) for item in report.get("explanations", ())]


def _sure_of(report: dict[str, Any], names: tuple[str, ...]) -> str:
    mass = dict(_explanations(report))
    return _sure(mass[names]) if names in mass else ""


def _sure(p: float) -> str:
    return _say(_SURE).format(p=stated(p))


_SURE = QT_TRANSLATE_NOOP("Gap", " (probability {p})")
_NO_GAP = QT_TRANSLATE_NOOP("Gap", "No gap{sure}: {last} mm, noise {floor}. What is left is noise.")
_NO_GAP_BUT = QT_TRANSLATE_NOOP(
    "Gap",
    "No gap worth a name{sure}: {last} mm, noise {floor}; what is left beyond chance is too small to matter.",
)
_TOO_SMALL = QT_TRANSLATE_NOOP("Gap", "What is left beyond chance is too small to matter.")
_SCATTER = QT_TRANSLATE_NOOP(
    "Gap", "Unexplained{sure}: single edges scatter more than those of a sound rig, and no known effect makes them."
)
_REMAINS = QT_TRANSLATE_NOOP(
    "Gap", "Unexplained{sure}: a gap remains that follows {covariate}; no known effect makes it."
)
_LEFT_OUT = QT_TRANSLATE_NOOP(
    "Gap",
    "Unexplained: a gap remains that follows {covariate}; the most probable cause, {names}{sure}, is not in the model: "
    "held-out runs have to support an effect.",
)
_WHOLE = (
    QT_TRANSLATE_NOOP("Gap", "{causes} explains the gap: {first} → {last} mm, noise {floor}."),
    QT_TRANSLATE_NOOP("Gap", "{causes} explain the gap: {first} → {last} mm, noise {floor}."),
)
_PART = (
    QT_TRANSLATE_NOOP("Gap", "{causes} is part of the gap: {first} → {last} mm, noise {floor}."),
    QT_TRANSLATE_NOOP("Gap", "{causes} are part of the gap: {first} → {last} mm, noise {floor}."),
)
_MAY_BE = QT_TRANSLATE_NOOP("Gap", "{causes} may be part of the gap: {first} → {last} mm, noise {floor}.")
_TRIED = QT_TRANSLATE_NOOP("Gap", "With {causes}: {first} → {last} mm, noise {floor}.")
"""For effects added by hand where there is no gap."""
_OR = QT_TRANSLATE_NOOP("Gap", "{one} or {other}")
_AND = QT_TRANSLATE_NOOP("Gap", "{some} and {last}")
_SIZED = QT_TRANSLATE_NOOP("Gap", "{name} {size} ({interval}; probability {p})")
_BY_TAPS = QT_TRANSLATE_NOOP("Gap", "{cause}, by the taps.")
_NOT_BY_EDGES = QT_TRANSLATE_NOOP("Gap", "Edges do not show it: the gap on held-out runs is {last} mm, noise {floor}.")
_OTHER_LAW = QT_TRANSLATE_NOOP(
    "Gap",
    "The curve is not Eq. 5: Eq. 5 misses it by {ms} ms RMS (probability {p}); see Results for the form that fits.",
)
_OTHER_LAW_ALONE = QT_TRANSLATE_NOOP(
    "Gap", "The curve is not Eq. 5 (probability {p}); see Results for the form that fits."
)
_TOLERATED = QT_TRANSLATE_NOOP("Gap", "Tolerated, too small to matter: {items}")
_NOISE = QT_TRANSLATE_NOOP("Gap", "Noise of the edges, as large as the session has it: {items}")
_DISAGREES = QT_TRANSLATE_NOOP("Gap", "Simulated again with the final model, what disagrees: {items}")
_STATISTICS = {
    "latency by run": QT_TRANSLATE_NOOP("Gap", "latency by run"),
    "stylus width": QT_TRANSLATE_NOOP("Gap", "stylus width"),
    "scatter of edges": QT_TRANSLATE_NOOP("Gap", "scatter of edges"),
    "repeated positions": QT_TRANSLATE_NOOP("Gap", "repeated positions"),
}
_ALSO = QT_TRANSLATE_NOOP("Gap", "Also possible: {sets}")
_NAMELESS = QT_TRANSLATE_NOOP("Gap", "something without a name")
_NO_EFFECT = QT_TRANSLATE_NOOP("Gap", "no effect")


def check_words(report: dict[str, Any]) -> str:
    """Statistics of simulated and measured session that disagree."""
    items = [
        f"{_say(_STATISTICS[one['name']])} {one['measured']:.3g} / {one['simulated']:.3g}"
        for one in report.get("check", ())
        if not one["agrees"]
    ]
    return _say(_DISAGREES).format(items="; ".join(items)) if items else ""


def _causes(report: dict[str, Any], sizes: dict[str, str]) -> list[str]:
    edges = [step for step in report["steps"] if step.get("covariate") != BY_TAPS]
    by_edges = [_cause(step) for step in edges]
    by_taps = [_cause(step) for step in report["steps"] if step.get("covariate") == BY_TAPS]
    out = []
    if by_edges:
        words = (_WHOLE if report["verdict"] == "explained" else _PART)[len(by_edges) > 1]
        if report["verdict"] != "explained" and all(step["probability"] < PROBABLE for step in edges):
            words = _MAY_BE
        first, causes = f"{report['gap_first_mm']:.2f}", ", ".join(by_edges)
        tried = report["verdict"] == "no_gap"
        words, causes = (_TRIED, causes) if tried else (words, _capital(causes))
        out.append(_say(words).format(causes=causes, first=first, **sizes))
    out += [_say(_BY_TAPS).format(cause=_capital(cause)) for cause in by_taps]
    if by_taps and not by_edges:
        out.append(_say(_NOT_BY_EDGES).format(**sizes))
    return out


def names_words(step: dict[str, Any]) -> str:
    """A step's effect and those indistinguishable from it: "clock drift or thermal drift"."""
    names = [effect_name(step["effect"]), *map(effect_name, step.get("indistinguishable_from") or ())]
    return reduce(lambda one, other: _say(_OR).format(one=one, other=other), names)


def _cause(step: dict[str, Any]) -> str:
    size, interval = main_size(step["effect"], step["parameters"])
    if not size:
        return names_words(step) + _sure(step["probability"])
    return _say(_SIZED).format(name=names_words(step), size=size, interval=interval, p=stated(step["probability"]))


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _say(text: str) -> str:
    return QCoreApplication.translate("Gap", text)
