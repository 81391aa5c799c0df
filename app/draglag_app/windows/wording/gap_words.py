"""What the gap report says, marked for translation: where effects act, what a gap follows, what was left and why."""

from __future__ import annotations

from typing import Any

from PySide6.QtCore import QCoreApplication

from draglag_app.windows.wording.effect_words import effect_name, main_size
from draglag_app.windows.wording.i18n import QT_TRANSLATE_NOOP

# Sentences of the library, with numbers in them (``library_words``).
GAP = (
    # of the session, and of what was left
    QT_TRANSLATE_NOOP("Library", "a second beam position separates a wider shadow from a wrong scale"),
    QT_TRANSLATE_NOOP("Library", "a session three times as long: a latency that settles stops, a drift goes on"),
    QT_TRANSLATE_NOOP("Library", "a second beam height: a bent panel bends there too, a curved beam moves along"),
    QT_TRANSLATE_NOOP("Library", "taps on the same clock: a clock's offset moves them, a prediction does not"),
    QT_TRANSLATE_NOOP("Library", "a slow line with turns: there a deadband stands still, a trailing contact does not"),
    QT_TRANSLATE_NOOP("Library", "taps before and after the runs separate a drifting clock from a creeping latency"),
    QT_TRANSLATE_NOOP("Library", "a chirp or step whose speed changes quickly"),
    QT_TRANSLATE_NOOP("Library", "a slower chirp or step: no edge of those here could be placed surely"),
    QT_TRANSLATE_NOOP("Library", "circles whose centre lies 30 mm off the beam"),
    QT_TRANSLATE_NOOP("Library", "a fixed trail hides in the latency law: a tap or a second stylus shows it"),
    QT_TRANSLATE_NOOP("Library", "taps timed on the same clock show it"),
    QT_TRANSLATE_NOOP("Library", "circles that travel across the whole width show it"),
    QT_TRANSLATE_NOOP("Library", "{n} circle runs with edges: at least 5 are needed"),
    QT_TRANSLATE_NOOP("Library", "1 circle run with edges: at least 5 are needed"),
    QT_TRANSLATE_NOOP("Library", "{n} drag speeds: at least 4, spread over a factor of 3, are needed"),
    QT_TRANSLATE_NOOP("Library", "1 drag speed: at least 4, spread over a factor of 3, are needed"),
    QT_TRANSLATE_NOOP("Library", "{n} edges: at least 80 are needed"),
    QT_TRANSLATE_NOOP(
        "Library", "no circle run shows where the stylus was: its touch positions are missing or not numbers"
    ),
    QT_TRANSLATE_NOOP(
        "Library",
        "edges and touch events of {n} of {of} circle runs lie at different times: both have to be on one clock",
    ),
    QT_TRANSLATE_NOOP(
        "Library",
        "touch times of {runs} go back or are no numbers: exported and imported again they are put in order",
    ),
    QT_TRANSLATE_NOOP(
        "Library",
        "runs that give a latency: {n}, at least 5 are needed. See with draglag analyze why the others give none, or "
        "record circles at more speeds.",
    ),
    QT_TRANSLATE_NOOP("Library", "the circles hardly travel sideways: slope and latency cannot be told apart"),
    QT_TRANSLATE_NOOP("Library", "{sizes}; gap on held-out runs {before} → {after} mm: too little for a name"),
    QT_TRANSLATE_NOOP(
        "Library", "it is worth less than the terms it takes or does not shrink the gap on held-out runs"
    ),
    # of an offset that taps show
    QT_TRANSLATE_NOOP("Library", "release taps lie {ms} ms off the fitted asymptote; edges do not show it"),
    # of a drift of the laser's clock, that analyze speaks of too
    QT_TRANSLATE_NOOP(
        "Library",
        "draglag analyze says nothing of this drift: the session holds no comparison of the laser's clock with the "
        "host's.",
    ),
    QT_TRANSLATE_NOOP(
        "Library",
        "draglag analyze sees the same drift: by the session's comparisons of clocks the laser's stamps run {ppm} ppm "
        "fast. It takes that out before it estimates.",
    ),
    QT_TRANSLATE_NOOP(
        "Library",
        "draglag analyze sees another drift: by the session's comparisons of clocks the laser's stamps run {ppm} ppm "
        "fast.",
    ),
    QT_TRANSLATE_NOOP(
        "Library",
        "draglag analyze sees the same drift: by the session's comparisons of clocks the laser's stamps run {ppm} ppm "
        "slow. It takes that out before it estimates.",
    ),
    QT_TRANSLATE_NOOP(
        "Library",
        "draglag analyze sees another drift: by the session's comparisons of clocks the laser's stamps run {ppm} ppm "
        "slow.",
    ),
    # of an effect added by hand
    QT_TRANSLATE_NOOP("Library", "added by hand; held-out gap changed by {low} to {high} mm (95 %): shrinks"),
    QT_TRANSLATE_NOOP("Library", "added by hand; held-out gap changed by {low} to {high} mm (95 %): open"),
    QT_TRANSLATE_NOOP("Library", "added by hand; held-out gap changed by {low} to {high} mm (95 %): grows"),
    # where an effect acts
    QT_TRANSLATE_NOOP("Library", "drag speed below {speed} mm/s"),
    QT_TRANSLATE_NOOP("Library", "in {count} stretches of time, {seconds} s in all"),
    QT_TRANSLATE_NOOP("Library", "growing with session time"),
    QT_TRANSLATE_NOOP("Library", "edges where the light returns"),
    QT_TRANSLATE_NOOP("Library", "every edge, outwards or inwards"),
    QT_TRANSLATE_NOOP("Library", "growing along the beam"),
    QT_TRANSLATE_NOOP("Library", "along the beam, most in the middle"),
    QT_TRANSLATE_NOOP("Library", "fading with session time"),
    QT_TRANSLATE_NOOP("Library", "where the stylus is slow or turns"),
    QT_TRANSLATE_NOOP("Library", "down against up"),
    QT_TRANSLATE_NOOP("Library", "growing across the panel"),
    QT_TRANSLATE_NOOP("Library", "along x, smoothly"),
    QT_TRANSLATE_NOOP("Library", "along the panel, periodic in the electrode pitch"),
    QT_TRANSLATE_NOOP("Library", "where the path bends"),
    QT_TRANSLATE_NOOP("Library", "above a threshold of speed"),
    QT_TRANSLATE_NOOP("Library", "where the speed changes"),
    QT_TRANSLATE_NOOP("Library", "everywhere"),
    QT_TRANSLATE_NOOP("Library", "{share} % of edges"),
    QT_TRANSLATE_NOOP("Library", "straight lines in the trace"),
    QT_TRANSLATE_NOOP("Library", "every tick of the host's loop"),
    QT_TRANSLATE_NOOP("Library", "every frame"),
    QT_TRANSLATE_NOOP("Library", "every stamp"),
    QT_TRANSLATE_NOOP("Library", "single frames, all through"),
    QT_TRANSLATE_NOOP("Library", "{count} frames at a time, all through"),
)

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
    """What a gap follows, in the operator's words: a covariate or an effect."""
    return QCoreApplication.translate("Gap", _FOLLOWS[covariate]) if covariate in _FOLLOWS else effect_name(covariate)


def headline(report: dict[str, Any]) -> str:
    """The verdict of a gap report (the design's JSON): the causes with their sizes, what they do to the gap."""
    sizes = {"last": f"{report['gap_last_mm']:.2f}", "floor": f"{report['noise_floor_mm']:.2f}"}
    verdict = str(report["verdict"])
    more = bool(report.get("passed_over"))  # beyond chance, without a name
    out = _causes(report, sizes)
    if verdict == "no_gap":
        out.append(_say(_NO_GAP_BUT if more else _NO_GAP).format(**sizes))
    elif verdict == "explained" and more:
        out.append(_say(_TOO_LITTLE))
    elif verdict == "unexplained" and report.get("unexplained_by") == "scatter":
        out.append(_say(_SCATTER))
    elif verdict == "unexplained":
        out.append(_say(_REMAINS).format(covariate=followed(str(report.get("unexplained_by")))))
    return " ".join(out)


_NO_GAP = QT_TRANSLATE_NOOP("Gap", "No gap: {last} mm, noise {floor}. What is left is noise.")
_NO_GAP_BUT = QT_TRANSLATE_NOOP(
    "Gap", "No gap worth a name: {last} mm, noise {floor}; what is left beyond chance is too little for one."
)
_TOO_LITTLE = QT_TRANSLATE_NOOP("Gap", "What is left beyond chance is too little for a name.")
_SCATTER = QT_TRANSLATE_NOOP(
    "Gap", "Unexplained: single edges scatter more than those of a sound rig, and no known effect makes them."
)
_REMAINS = QT_TRANSLATE_NOOP("Gap", "Unexplained: a gap remains that follows {covariate}; no known effect makes it.")
_WHOLE = (
    QT_TRANSLATE_NOOP("Gap", "{causes} explains the gap: {first} → {last} mm, noise {floor}."),
    QT_TRANSLATE_NOOP("Gap", "{causes} explain the gap: {first} → {last} mm, noise {floor}."),
)
_PART = (
    QT_TRANSLATE_NOOP("Gap", "{causes} is part of the gap: {first} → {last} mm, noise {floor}."),
    QT_TRANSLATE_NOOP("Gap", "{causes} are part of the gap: {first} → {last} mm, noise {floor}."),
)
_OR = QT_TRANSLATE_NOOP("Gap", "{one} or {other}")
_BY_TAPS = QT_TRANSLATE_NOOP("Gap", "{cause}, by the taps.")
_NOT_BY_EDGES = QT_TRANSLATE_NOOP("Gap", "Edges do not show it: the gap on held-out runs is {last} mm, noise {floor}.")


def _causes(report: dict[str, Any], sizes: dict[str, str]) -> list[str]:
    by_edges = [_cause(step) for step in report["steps"] if step.get("covariate") != "taps"]
    by_taps = [_cause(step) for step in report["steps"] if step.get("covariate") == "taps"]
    out = []
    if by_edges:
        words = (_WHOLE if report["verdict"] == "explained" else _PART)[len(by_edges) > 1]
        first = f"{report['gap_first_mm']:.2f}"
        out.append(_say(words).format(causes=_capital(", ".join(by_edges)), first=first, **sizes))
    out += [_say(_BY_TAPS).format(cause=_capital(cause)) for cause in by_taps]
    if by_taps and not by_edges:
        out.append(_say(_NOT_BY_EDGES).format(**sizes))
    return out


def _cause(step: dict[str, Any]) -> str:
    twins = [effect_name(step["effect"]), *map(effect_name, step.get("indistinguishable_from") or ())]
    name = _say(_OR).format(one=twins[0], other=", ".join(twins[1:])) if twins[1:] else twins[0]
    return f"{name} {main_size(step['parameters'])}".rstrip()


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _say(text: str) -> str:
    return QCoreApplication.translate("Gap", text)
