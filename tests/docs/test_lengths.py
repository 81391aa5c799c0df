"""The check of functions' lengths finds what it looks for."""

from __future__ import annotations

from docs.lengths import MOST_LINES, too_long


def function_of(lines: int, docstring: str = "A.") -> str:
    return "\n".join(["def long():", f'    """{docstring}"""', *["    pass"] * (lines - 2)])


def test_a_function_of_more_lines_needs_a_reason() -> None:
    assert list(too_long(function_of(MOST_LINES))) == []
    assert list(too_long(function_of(MOST_LINES + 1))) == [("long", 1, MOST_LINES + 1)]
    assert list(too_long(function_of(MOST_LINES + 1, "A; in one piece, as its order is the method."))) == []
