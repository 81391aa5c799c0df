"""Size and docstrings of Python sources, and what an import costs.

``python -m tests.bench.shape FOLDER … --import CODE …``

A public name is a class or function without a leading underscore, in a public class or a module; setters and overloads
do not count. The length of a function is without its docstring.
"""

from __future__ import annotations

import argparse
import ast
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

Function = ast.FunctionDef | ast.AsyncFunctionDef
LONG_FUNCTION, LONG_FILE = 50, 500
FRESH = 15  # processes an import is timed in; the fastest counts


def definitions(node: ast.AST, public: bool = True) -> Iterator[tuple[Function | ast.ClassDef, bool]]:
    """Classes and functions, each with whether it is public."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, Function | ast.ClassDef):
            seen = public and not child.name.startswith("_")
            yield child, seen and not _is_more_of_one(child)
            yield from definitions(child, seen and isinstance(child, ast.ClassDef))
        else:
            yield from definitions(child, public)


def _is_more_of_one(node: Function | ast.ClassDef) -> bool:
    marks = [ast.unparse(mark) for mark in node.decorator_list]
    return any(mark.endswith(".setter") or mark.split(".")[-1] == "overload" for mark in marks)


def length(function: Function) -> int:
    """Lines without the docstring."""
    first = function.body[0]
    docstring = first.end_lineno - first.lineno + 1 if ast.get_docstring(function) is not None else 0
    return function.end_lineno - function.lineno + 1 - docstring


def describe(folder: Path) -> str:
    """One line about all sources of a folder."""
    texts = {path: path.read_text("utf-8") for path in sorted(folder.rglob("*.py"))}
    lines = [text.count("\n") for text in texts.values()]
    found = [one for text in texts.values() for one in definitions(ast.parse(text))]
    lengths = [length(node) for node, _ in found if isinstance(node, Function)]
    docstrings = [ast.get_docstring(node) or "" for node, public in found if public]
    return (
        f"{folder}: {len(lines)} files, median {statistics.median(lines):.0f} lines, longest {max(lines)}, "
        f"{sum(n > LONG_FILE for n in lines)} over {LONG_FILE}; {len(lengths)} functions, longest {max(lengths)}, "
        f"{sum(n > LONG_FUNCTION for n in lengths)} over {LONG_FUNCTION}; {len(docstrings)} public names, "
        f"{sum(map(bool, docstrings))} with a docstring, {sum('>>>' in text for text in docstrings)} with an example"
    )


def fastest_s(code: str) -> float:
    """The fastest of some fresh processes that execute the code."""
    times = []
    for _ in range(FRESH):
        began = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], check=True)
        times.append(time.perf_counter() - began)
    return min(times)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="*", type=Path, metavar="FOLDER")
    parser.add_argument("--import", nargs="+", default=[], metavar="CODE", dest="codes")
    given = parser.parse_args()
    for folder in given.folders:
        print(describe(folder))
    empty_s = fastest_s("pass") if given.codes else 0.0
    for code in given.codes:
        print(f"{code}: {1e3 * (fastest_s(code) - empty_s):.0f} ms")


if __name__ == "__main__":
    main()
