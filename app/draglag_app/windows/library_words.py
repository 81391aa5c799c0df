"""Sentences of the library in the operator's language: the library says them in English, with numbers in them."""

from __future__ import annotations

import re
from functools import cache

from PySide6.QtCore import QCoreApplication

from draglag_app.windows.i18n import QT_TRANSLATE_NOOP

# What ``analyze`` may say about a session's clocks, runs and curve, and what the session itself says while it records.
SENTENCES = (
    QT_TRANSLATE_NOOP(
        "Library",
        "The laser's clock shifts the latency of {runs} by up to ±{worst} ms (more than {limit} ms); the intervals "
        "hold it. Use another port and close other programs.",
    ),
    QT_TRANSLATE_NOOP(
        "Library",
        "The laser's clock was never compared with the host's in {runs}: a shift of the latency would not show. "
        "Record again with the clocks compared.",
    ),
    QT_TRANSLATE_NOOP("Library", "The {name}'s clock shifts the tap latencies by up to ±{worst} ms."),
    QT_TRANSLATE_NOOP("Library", "The clock comparisons cannot be read: {problem}."),
    QT_TRANSLATE_NOOP(
        "Library", "The {name} clock does not run evenly: its comparisons contradict each other by {slack} ms."
    ),
    QT_TRANSLATE_NOOP(
        "Library",
        "The {name} clock drifts by {ppm} ppm ({ms} ms in 60 s); it is corrected, but more than the paper's 1 ms in "
        "60 s.",
    ),
    QT_TRANSLATE_NOOP("Library", "{run}: no latency ({flags})"),
    QT_TRANSLATE_NOOP("Library", "no run gave a latency, so there is no curve. Record runs at several speeds."),
    QT_TRANSLATE_NOOP(
        "Library",
        "{n} runs cannot determine the {k} parameters of {form}. Measure more speeds or choose a simpler form.",
    ),
    QT_TRANSLATE_NOOP("Library", "the asymptote could not be tied: the session has no release taps"),
    QT_TRANSLATE_NOOP("Library", "the form {form} has no asymptote to tie. Choose an exponential form."),
    QT_TRANSLATE_NOOP("Library", "Stopped by the operator."),
    QT_TRANSLATE_NOOP("Library", "Tap the spot {n} times"),
    QT_TRANSLATE_NOOP("Library", "Comparing clocks: leave the screen alone"),
    QT_TRANSLATE_NOOP("Library", "taps were left out: there is no {roles} source"),
    QT_TRANSLATE_NOOP("Library", "{role} did not report up to the end of the run"),
    QT_TRANSLATE_NOOP("Library", "only {free} MB are free in {folder}: make room"),
)


def in_words(sentence: str) -> str:
    """The sentence in the operator's language, with its own numbers; one that is not known stays as it is."""
    for template in SENTENCES:
        found = _pattern(template).fullmatch(sentence)
        if found is not None:
            return QCoreApplication.translate("Library", template).format(**found.groupdict())
    return sentence


@cache
def _pattern(template: str) -> re.Pattern[str]:
    parts = re.split(r"{(\w+)}", template)
    return re.compile("".join(f"(?P<{part}>.+?)" if k % 2 else re.escape(part) for k, part in enumerate(parts)))
