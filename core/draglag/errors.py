"""The one error that reaches people: what is wrong, and what to do about it."""

from __future__ import annotations


class DraglagError(Exception):
    """The data or the rig says no.

    Args:
        problem: one plain sentence: what is wrong and where (file, line, run).
        remedy: what to do about it; empty where nothing sensible can be said.
    """

    def __init__(self, problem: str, remedy: str = "") -> None:
        self.problem = problem.rstrip(". ") + "."
        self.remedy = remedy.rstrip(". ") + "." if remedy else ""
        # A remedy that begins small goes on with the sentence.
        joint = "; " if self.remedy[:1].islower() else ". " if self.remedy else "."
        super().__init__(self.problem[:-1] + joint + self.remedy)


class DataError(DraglagError):
    """A file or its contents cannot be used."""


class EstimateError(DraglagError):
    """The data is readable but does not determine what was asked."""
