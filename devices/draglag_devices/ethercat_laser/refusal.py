"""Refusals of the bus; few imports, as the privileged process stays small."""

from __future__ import annotations

from draglag.messages import phrase


class Refusal(Exception):
    """Why the bus cannot be used; ``code`` is for programs."""

    def __init__(self, code: str, problem: str, remedy: str = "") -> None:
        self.code, self.problem, self.remedy = code, phrase(problem), phrase(remedy)
        super().__init__(problem)
