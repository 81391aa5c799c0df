"""Functions over 60 lines without the reason ("in one piece") in their docstring: `./run check` allows none."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

MOST_LINES = 60
REASON = "in one piece"
ROOTS = ("app", "core", "devices", "resources")


def too_long(source: str) -> Iterator[tuple[str, int, int]]:
    """(name, line, number of lines) of each, from its ``def`` on."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            lines = (node.end_lineno or node.lineno) - node.lineno + 1
            if lines > MOST_LINES and REASON not in (ast.get_docstring(node) or ""):
                yield node.name, node.lineno, lines


def main() -> int:
    root, found = Path(__file__).parents[2], 0
    for folder in ROOTS:
        for path in sorted((root / folder).rglob("*.py")):
            for name, line, lines in too_long(path.read_text("utf-8")):
                found += 1
                print(f"{path.relative_to(root)}:{line}: {name} has {lines} lines, more than {MOST_LINES}")
    return int(found > 0)


if __name__ == "__main__":
    sys.exit(main())
