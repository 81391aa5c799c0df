"""The Record page's words between runs."""

from __future__ import annotations

import math
from collections.abc import Sequence

from PySide6.QtCore import QCoreApplication

from draglag.latency import RunEstimate
from draglag.latency.conduct import PRACTICE
from draglag_app.windows.wording import words

# So many of the large letters have room next to the buttons of a rest, at 1280 px.
_LARGE_LETTERS = 31


def tr(text: str) -> str:
    return QCoreApplication.translate("BetweenRuns", text)


def verdict_words(estimate: RunEstimate, preliminary: bool, queued: bool = False) -> tuple[str, str, str]:
    """(level, words, more): "✓ 38.7 ± 0.1 ms", "▲ few edges: repeat? F7" or "practice: 38.7 ± 0.1 ms".

    ``more``: what has no room. ``queued``: repeated anyway.
    """
    if preliminary:
        return "", words.latency_text(estimate) + " …", ""
    if PRACTICE in estimate.flags:
        return "", tr("practice: {latency}").format(latency=words.latency_text(estimate)), ""
    level, reasons = words.verdict_parts(estimate)
    if level == "ok":
        return "good", "✓ " + words.latency_text(estimate), ""
    mark = "▲" if level == "warning" else "✕"
    large, n_shown = _largest(mark, reasons, queued)
    others = reasons[n_shown:]
    more = [tr("also {reasons}").format(reasons=", ".join(others))] if others else []
    more += [comes_again()] if queued else []
    return level, large, " · ".join(more)


def _largest(mark: str, reasons: Sequence[str], queued: bool) -> tuple[str, int]:
    for n in range(len(reasons), 0, -1):
        why = ", ".join(reasons[:n])
        if n < len(reasons):
            large = tr("{mark} {why} and {n} more").format(mark=mark, why=why, n=len(reasons) - n)
        else:
            large = f"{mark} {why}"
        if len(large) <= _LARGE_LETTERS:
            break
    if n == len(reasons) == 1 and not queued:
        asks = tr("{mark} {why}: repeat? F7").format(mark=mark, why=why)
        large = asks if len(asks) <= _LARGE_LETTERS else large  # a button names F7 too
    return large, n


def comes_again() -> str:
    """The sentence on a queued run."""
    return tr("recorded again at the end; Ctrl+Z cancels that")


def rest_words(
    left_s: float,
    session_left_s: float,
    first: bool,
    again: bool,
    more: str = "",
    coming: str = "run",
    repeats: bool = True,
) -> str:
    """Time left in rest (infinite: until a key) and session, ``more``, keys.

    ``coming``: "run", "taps" or "clocks"; ``repeats``: whether the last run can be recorded again.

    The keys come last: if cut off, buttons name them.
    """
    parts = []
    if math.isfinite(left_s):
        parts.append(tr("Rest {time}").format(time=words.duration(math.ceil(max(0.0, left_s)))))
    if more:
        parts.append(more)
    if again:
        parts.append(tr("the last run is repeated next; F6 begins it now"))
    parts.append(session_left(session_left_s))
    if not again:
        parts.append(_keys(first, coming, repeats))
    return " · ".join(parts)


def _keys(first: bool, coming: str, repeats: bool) -> str:
    if coming == "taps":
        begins = tr("F6 begins the taps now")
    elif coming == "clocks":
        begins = tr("F6 begins the comparison of the clocks now")
    elif first:
        return tr("F6 begins the first run now")
    elif repeats:
        return tr("F6 begins the next run now, F7 repeats the last one")
    else:
        return tr("F6 begins the next run now")
    return begins + tr(", F7 repeats the last run") if repeats and not first else begins


def in_rest_s(planned_s: float, rest_s: float, left_s: float) -> float:
    """Time left in the session, of which the rest is planned whole; one that waits for a key (infinite) takes none."""
    return max(0.0, planned_s - rest_s + max(0.0, left_s)) if math.isfinite(left_s) else planned_s


def session_left(left_s: float) -> str:
    """Time left in the session."""
    return tr("{time} left in the session").format(time=words.duration(left_s))
