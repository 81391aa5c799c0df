"""The library's sentences, translated by template (``draglag.messages``)."""

from __future__ import annotations

from collections.abc import Iterable

from PySide6.QtCore import QCoreApplication

from draglag.errors import DraglagError
from draglag.messages import Message, phrase
from draglag_app.windows.wording.button_words import IN_BUTTONS
from draglag_app.windows.wording.effect_words import effect_name
from draglag_app.windows.wording.i18n import QT_TRANSLATE_NOOP
from draglag_app.windows.wording.words import flag_name, form_name, target_name

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
    "practice": QT_TRANSLATE_NOOP("Source", "protocol"),
    "listener": QT_TRANSLATE_NOOP("Source", "program"),
}

# Why a run ended that the participant's window was asked to end.
ESC = QT_TRANSLATE_NOOP("Library", "the run was aborted with Esc in the participant's window. F7 repeats it.")
CLOSED = QT_TRANSLATE_NOOP(
    "Library", "the run was aborted: somebody closed the participant's window, which stays open. F7 repeats it."
)


def in_words(text: str) -> str:
    """A message, translated with those in it; else English."""
    said = phrase(text)
    words = QCoreApplication.translate("Library", IN_BUTTONS.get(said.template, said.template))
    return words.format(**{name: _argument(name, value) for name, value in said.arguments.items()})


def sentences(known: Iterable[str]) -> str:
    """Several sentences, translated, each with a full stop."""
    said = map(in_words, known)
    return " ".join(text if text.endswith((".", "!", "?")) else f"{text}." for text in said)


def fault_words(problem: str, remedy: str) -> str:
    """Problem and remedy, translated."""
    return in_words(DraglagError(problem, remedy).message)


def source_name(source: str) -> str:
    """The source's name, translated; an address is unchanged."""
    return QCoreApplication.translate("Source", _SOURCES[source]) if source in _SOURCES else source


def _argument(name: str, value: object) -> object:
    if isinstance(value, Message):
        return in_words(value)
    words_of = _NAMES.get(name)
    return value if words_of is None else words_of(str(value))


def _flag_names(flags: str) -> str:
    return ", ".join(map(flag_name, flags.split(", ")))


_NAMES = {
    "role": source_name, "flags": _flag_names, "effect": effect_name, "form": form_name, "kind": target_name,
}  # fmt: skip
"""Place in a template → the windows' words for its ids."""
