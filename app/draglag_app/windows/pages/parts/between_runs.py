"""What the Record page says between runs: the verdict on the last one, the rest that is left, what comes next."""

from __future__ import annotations

import math

from PySide6.QtCore import QCoreApplication

from draglag.latency import RunEstimate
from draglag_app.windows.wording import words


def tr(text: str) -> str:
    return QCoreApplication.translate("BetweenRuns", text)


def verdict_words(estimate: RunEstimate, preliminary: bool) -> tuple[str, str]:
    """(level, words) that can be read across a room: "✓ 38.7 ± 0.1 ms", "▲ few edges: repeat? F7"."""
    if preliminary:
        return "", words.latency_text(estimate) + " …"
    level, text = words.verdict(estimate)
    if level == "ok":
        return "good", "✓ " + words.latency_text(estimate)
    mark = "▲" if level == "warning" else "✕"
    if "," in text:  # several reasons need the room; the line below and the button name F7
        return "warning" if level == "warning" else "bad", f"{mark} {text}"
    return "warning" if level == "warning" else "bad", tr("{mark} {why}: repeat? F7").format(mark=mark, why=text)


def rest_words(left_s: float, session_left_s: float, first: bool, again: bool, more: str = "") -> str:
    """How long the rest and the session still last, and ``more``; then what the keys do. Infinite: until a key.

    The keys stand last: where there is too little room, the buttons still name them.
    """
    parts = []
    if math.isfinite(left_s):
        parts.append(tr("Rest {time}").format(time=words.duration(math.ceil(max(0.0, left_s)))))
    if more:
        parts.append(more)
    if again:
        parts.append(tr("the last run comes once more; F6 begins it now"))
    parts.append(session_left(session_left_s))
    if first and not again:
        parts.append(tr("F6 begins the first run now"))
    elif not again:
        parts.append(tr("F6 begins the next run now, F7 repeats the last one"))
    return " · ".join(parts)


def session_left(left_s: float) -> str:
    """How long the session still takes."""
    return tr("{time} left in the session").format(time=words.duration(left_s))
