"""The one error that reaches people: what is wrong, and what to do about it."""

from __future__ import annotations

import re

# What a file's keys and names may hold and a terminal would obey: control characters, line ends, changes of direction.
_UNPRINTABLE = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069]+")


def one_line(text: str) -> str:
    """The text without line ends and other control characters."""
    return _UNPRINTABLE.sub(" ", text)


class DraglagError(Exception):
    """The data or the rig says no.

    Args:
        problem: one plain sentence: what is wrong and where (file, line, run).
        remedy: what to do about it; empty where nothing sensible can be said.
    """

    def __init__(self, problem: str, remedy: str = "") -> None:
        self.problem = one_line(problem).rstrip(". ") + "."
        self.remedy = one_line(remedy).rstrip(". ") + "." if remedy else ""
        # A remedy that begins small goes on with the sentence.
        joint = "; " if self.remedy[:1].islower() else ". " if self.remedy else "."
        super().__init__(self.problem[:-1] + joint + self.remedy)


class DataError(DraglagError):
    """A file or its contents cannot be used."""


class EstimateError(DraglagError):
    """The data is readable but does not determine what was asked."""
