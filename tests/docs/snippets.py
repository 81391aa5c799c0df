"""The code on the pages of the documentation, to be run as it stands."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import chdir, contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).parents[2]
_FENCE = re.compile(r"^```(?P<language>\w+)[^\n]*\n(?P<code>.*?)^```$", re.MULTILINE | re.DOTALL)
# Programs of other languages: what runs a file of it, and how its name ends.
PROGRAMS = {
    "octave": (["octave-cli", "--quiet", "--no-init-file", "--no-history"], ".m"),
    "r": (["Rscript", "--vanilla"], ".R"),
    "matlab": (["matlab", "-batch"], ".m"),
}


@dataclass(frozen=True)
class Snippet:
    """One block of code; ``line``: where it begins on its page."""

    page: Path
    line: int
    language: str
    code: str

    @property
    def where(self) -> str:
        return f"{self.page.relative_to(ROOT)}:{self.line}"


def pages() -> list[Path]:
    """The README and every page of docs."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def snippets(page: Path) -> list[Snippet]:
    """The blocks of code on a page, in order."""
    text = page.read_text("utf-8")
    return [
        Snippet(page, text.count("\n", 0, found.start()) + 2, found["language"], found["code"])
        for found in _FENCE.finditer(text)
    ]


def run_page(blocks: list[Snippet], folder: Path) -> list[str]:
    """Modules that are not installed, after running a page's Python and bash in order, in one folder and namespace; a
    block that needs one is left at that line."""
    module = ModuleType("page_of_the_documentation")
    names = module.__dict__
    missing = []
    with chdir(folder), _known(module):
        for block in blocks:
            if block.language == "bash":
                _bash(block)
            elif block.language == "python":
                # Lines of the page, so that a traceback points there.
                code = compile("\n" * (block.line - 1) + block.code, str(block.page), "exec")
                try:
                    exec(code, names)
                except ModuleNotFoundError as error:
                    missing.append(str(error.name))
    return missing


@contextmanager
def _known(module: ModuleType) -> Iterator[None]:
    """Put the page among the imported modules, where dataclasses look for theirs.

    Only it is removed again: matplotlib cannot be imported twice.
    """
    sys.modules[module.__name__] = module
    try:
        yield
    finally:
        del sys.modules[module.__name__]


def _bash(block: Snippet) -> None:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", block.code], env={**os.environ, "PATH": path}, capture_output=True, text=True
    )
    assert done.returncode == 0, f"{block.where}: {done.stderr}"
