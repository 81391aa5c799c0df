"""What the gap report says, marked for translation: where effects act, what a gap follows, what was left and why."""

from __future__ import annotations

from PySide6.QtCore import QCoreApplication

from draglag_app.windows.wording.effect_words import effect_name
from draglag_app.windows.wording.i18n import QT_TRANSLATE_NOOP

# Sentences of the library, with numbers in them (``library_words``).
GAP = (
    # of the session, and of what was left
    QT_TRANSLATE_NOOP("Library", "a second beam position separates a wider shadow from a wrong scale"),
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
    QT_TRANSLATE_NOOP(
        "Library",
        "release taps lie {ms} ms off the fitted asymptote: a law of the taps' own latency would leave {mm} mm",
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
