"""Keeps control characters in names and notes of a file from a terminal."""

from __future__ import annotations

import sys
from io import TextIOWrapper

from draglag.errors import one_line


class _Printable(TextIOWrapper):
    """Text without control characters other than tabs and line ends."""

    def write(self, text: str, /) -> int:
        lines = (part if part in "\n\t" else one_line(part) for part in _parts(text))
        super().write("".join(lines))
        return len(text)


def _parts(text: str) -> list[str]:
    parts: list[str] = []
    for line in text.split("\n"):
        parts += [piece for cell in line.split("\t") for piece in (cell, "\t")][:-1]
        parts.append("\n")
    return parts[:-1]


def guard_output() -> None:
    """Let only printable text reach a terminal."""
    out = sys.stdout
    if isinstance(out, TextIOWrapper) and not isinstance(out, _Printable) and out.isatty():
        encoding, errors, by_line = out.encoding, out.errors, out.line_buffering
        sys.stdout = _Printable(out.detach(), encoding, errors, line_buffering=by_line)
