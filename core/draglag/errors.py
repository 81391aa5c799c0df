"""The errors that reach people: problem and remedy."""

from __future__ import annotations

import re
from typing import Any

from draglag.messages import Message, cleaned, message, phrase, without_stop

# What a file's keys and names may hold and a terminal would obey: control characters, line ends, changes of direction.
_UNPRINTABLE = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069]+")


def one_line(text: str) -> str:
    """The text without line ends and other control characters."""
    return _UNPRINTABLE.sub(" ", text)


class DraglagError(Exception):
    """A problem with data or rig.

    Args:
        problem: one sentence: what is wrong and where (file, line, run).
        remedy: what to do about it.

    Both are literals or made by ``message``.
    """

    problem: Message
    remedy: Message
    message: Message

    def __init__(self, problem: str, remedy: str = "") -> None:
        said, cure = _line(problem), _line(remedy)
        self.problem = message("{sentence}.", sentence=said)
        self.remedy = message("{sentence}.", sentence=cure) if cure else phrase("")
        self.message = self.problem
        if cure:
            # A remedy that begins small goes on with the sentence.
            small = cure[:1].islower()
            self.message = message(
                "{problem}; {remedy}." if small else "{problem}. {remedy}.", problem=said, remedy=cure
            )
        super().__init__(str(self.message))

    def __reduce__(self) -> tuple[Any, ...]:
        # Not by calling the class: those derived from this one take other arguments.
        return _restored, (type(self), self.args), self.__dict__


class DataError(DraglagError):
    """A file or its contents cannot be used."""


class EstimateError(DraglagError):
    """The data is readable but does not determine what was asked."""


def message_of(error: BaseException) -> Message:
    """An exception's message, else its text as a message."""
    if isinstance(error, DraglagError):
        return error.message
    given = error.args[0] if len(error.args) == 1 else None
    return given if isinstance(given, Message) else phrase(str(error))


def cause(error: OSError) -> Message:
    """The system's reason for an error."""
    return phrase(error.strerror or str(error))


def _line(text: str) -> Message:
    return without_stop(cleaned(text, one_line))


def _restored(kind: type[DraglagError], arguments: tuple[Any, ...]) -> DraglagError:
    return kind.__new__(kind, *arguments)
