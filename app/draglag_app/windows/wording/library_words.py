"""Sentences of library and instruments in the operator's language: they say them in English, with numbers in them."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cache

from PySide6.QtCore import QCoreApplication

from draglag.errors import DraglagError
from draglag_app.windows.wording.button_words import IN_BUTTONS, LIBRARY_BUTTONS, REMEDY_BUTTONS
from draglag_app.windows.wording.device_words import NOTICES, PROBLEMS, REASONS, REMEDIES
from draglag_app.windows.wording.gap_words import GAP
from draglag_app.windows.wording.i18n import QT_TRANSLATE_NOOP
from draglag_app.windows.wording.words import flag_name

_SOURCES = {
    "touch": QT_TRANSLATE_NOOP("Source", "touchscreen"),
    "laser": QT_TRANSLATE_NOOP("Source", "laser sensor"),
    "walt": QT_TRANSLATE_NOOP("Source", "WALT"),
    "file": QT_TRANSLATE_NOOP("Source", "file"),
    "disk": QT_TRANSLATE_NOOP("Source", "disk"),
    "protocol": QT_TRANSLATE_NOOP("Source", "protocol"),
    "operator": QT_TRANSLATE_NOOP("Source", "operator"),
    "participant": QT_TRANSLATE_NOOP("Source", "participant"),
    "standstill": QT_TRANSLATE_NOOP("Source", "computer"),
}

# Why a run ended that the participant's window was asked to end.
ESC = QT_TRANSLATE_NOOP("Library", "the run was aborted with Esc in the participant's window. F7 repeats it.")
CLOSED = QT_TRANSLATE_NOOP(
    "Library", "the run was aborted: somebody closed the participant's window, which stays open. F7 repeats it."
)

# What ``analyze`` may say about a session's clocks, runs and curve, and what the session itself says while it records.
SENTENCES = (
    *LIBRARY_BUTTONS,
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
        "The {name} clock runs {ppm} ppm fast ({ms} ms in 60 s); it is corrected, but more than the paper's 1 ms in "
        "60 s.",
    ),
    QT_TRANSLATE_NOOP(
        "Library",
        "The {name} clock runs {ppm} ppm slow ({ms} ms in 60 s); it is corrected, but more than the paper's 1 ms in "
        "60 s.",
    ),
    QT_TRANSLATE_NOOP(
        "Library",
        "The stylus width of {runs} disagrees with the ruler ({known} mm) by more than noise and sensor explain: a "
        "tilted stylus or wrong edges can do this. Look at the alignment, or record again.",
    ),
    QT_TRANSLATE_NOOP("Library", "{run}: no latency ({flags})"),
    QT_TRANSLATE_NOOP("Library", "no run gave a latency, so there is no curve. Record runs at several speeds."),
    QT_TRANSLATE_NOOP(
        "Library",
        "{n} different speeds are too few for a curve: at least {k} are needed. Record runs at more speeds.",
    ),
    QT_TRANSLATE_NOOP(
        "Library",
        "The raw data were changed after recording: the checksum of the file does not match. Use an untouched copy.",
    ),
    QT_TRANSLATE_NOOP(
        "Library",
        "{n} runs cannot determine the {k} parameters of {form}. Measure more speeds or choose a simpler form.",
    ),
    QT_TRANSLATE_NOOP("Library", "the asymptote could not be tied: the session has no release taps"),
    QT_TRANSLATE_NOOP("Library", "the form {form} has no asymptote to tie. Choose an exponential form."),
    QT_TRANSLATE_NOOP("Library", "Stopped by the operator."),
    QT_TRANSLATE_NOOP(
        "Library",
        "No touch has come in the first {seconds} s of {run}: check that the stylus is on the screen under test and "
        "that this is the touchscreen in use.",
    ),
    QT_TRANSLATE_NOOP("Library", "Tap the spot {n} times"),
    QT_TRANSLATE_NOOP("Library", "Comparing clocks: leave the screen alone"),
    QT_TRANSLATE_NOOP("Library", "taps were left out: there is no {roles} source"),
    QT_TRANSLATE_NOOP("Library", "{role} did not report up to the end of the run"),
    QT_TRANSLATE_NOOP(
        "Library",
        "The touches are {how} against the target: screen or touchscreen was turned after the calibration. Stop, "
        "calibrate the touchscreen again, and start again.",
    ),
    QT_TRANSLATE_NOOP("Library", "only {free} MB are free in {folder}: make room"),
    QT_TRANSLATE_NOOP(
        "Library",
        "the computer was suspended for {s} s: nothing was recorded meanwhile. Keep it awake, and record the "
        "run again.",
    ),
    QT_TRANSLATE_NOOP(
        "Library",
        "this program did not run for {s} s (it was stopped, or the computer was too busy): the target stood still and "
        "events may be lost. Record the run again.",
    ),
    ESC,
    CLOSED,
    *GAP,
)


# Where the next of several faults begins, reported together.
_NEXT = re.compile(r"(?<=\. )(?=(?:evdev|ethercat|serial|sim|replay|csv):\S*: )")
_ADDRESS = r"(?:(?P<_source>.+?): )?"
_REMEDY = r"(?:(?P<_joint>; |\. |\.)(?P<_remedy>.+)?)?"


def in_words(sentence: str) -> str:
    """The sentence in the operator's language, with its own numbers; one that is not known stays as it is.

    Those of instruments are "address: problem. remedy." (see ``DraglagError``), and may be several.
    """
    known = _known(sentence, "Library", SENTENCES)
    if known is not None:
        return known
    return "".join(_device_words(part) for part in _NEXT.split(sentence))


def sentences(known: Iterable[str]) -> str:
    """Several sentences in the operator's language, each with a stop at its end."""
    said = map(in_words, known)
    return " ".join(text if text.endswith((".", "!", "?")) else f"{text}." for text in said)


def fault_words(problem: str, remedy: str) -> str:
    """What is wrong and what to do about it, in the operator's language."""
    return in_words(str(DraglagError(problem, remedy)))


def source_name(source: str) -> str:
    """Who says something, in the operator's language; an address stays as it is."""
    return QCoreApplication.translate("Source", _SOURCES[source]) if source in _SOURCES else source


def _device_words(sentence: str) -> str:
    prefix = re.match(r"(?P<_source>\S+): ", sentence)
    source = prefix["_source"] if prefix else None
    rest = sentence[prefix.end() :] if prefix else sentence
    for whole, text in (("", sentence), (f"{source}: ", rest)):
        known = _known(text, "Device", NOTICES)
        if known is not None:
            return whole + known
    for template in PROBLEMS:
        found = _pattern(template, _ADDRESS, _REMEDY).fullmatch(sentence.rstrip())
        if found is None:
            continue
        places = found.groupdict()
        source, joint, remedy = places.pop("_source"), places.pop("_joint"), places.pop("_remedy")
        text_out = f"{source}: " if source else ""
        text_out += _filled("Device", template, places) + (joint or "")
        if remedy:
            end = "." if remedy.endswith(".") else ""
            text_out += (_known(remedy.removesuffix("."), "Device", REMEDIES) or remedy.removesuffix(".")) + end
        return text_out + sentence[len(sentence.rstrip()) :]
    return _known(sentence.removesuffix("."), "Device", REMEDIES) or _last_in_buttons(sentence)


def _last_in_buttons(sentence: str) -> str:
    """A sentence that is not known, with the remedy at its end in buttons where that names a command."""
    for template in REMEDY_BUTTONS:
        found = _pattern(template, r"(?P<_problem>.+?(?:; |\. ))", r"\.?").fullmatch(sentence)
        if found is not None:
            places = found.groupdict()
            return places.pop("_problem") + _filled("Device", template, places) + "."
    return sentence


def _known(text: str, context: str, templates: tuple[str, ...]) -> str | None:
    for template in templates:
        found = _pattern(template).fullmatch(text)
        if found is not None:
            return _filled(context, template, found.groupdict())
    return None


def _filled(context: str, template: str, places: dict[str, str]) -> str:
    words = {name: _part(name, value) for name, value in places.items()}
    return QCoreApplication.translate(context, IN_BUTTONS.get(template, template)).format(**words)


def _part(name: str, value: str) -> str:
    """What stands in a place of a sentence, in the operator's words."""
    if name == "role":
        return source_name(value)
    if name == "flags":
        return ", ".join(map(flag_name, value.split(", ")))
    return _known(value, "Device", REASONS) or value


@cache
def _pattern(template: str, before: str = "", after: str = "") -> re.Pattern[str]:
    parts = re.split(r"{(\w+)}", template)
    inner = "".join(f"(?P<{part}>.+?)" if k % 2 else re.escape(part) for k, part in enumerate(parts))
    return re.compile(before + inner + after, re.DOTALL)
