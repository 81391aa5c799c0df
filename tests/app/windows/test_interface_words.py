"""Names that were taken out of the interface stay out, and those that replaced them are there."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import draglag
import draglag_app
from draglag_resources import resource
from message_templates import texts_of_windows

ROOT = Path(__file__).parents[3]
# Removed → what stands there instead.
INSTEAD = {
    "Find and close": "Explain the gap",
    "Take it out again": "Remove effect",
    "Leave out": "Exclude…",
    "Take in again": "Include",
    "Rivals": "Show alternative fits",
    "Tie to taps": "Fix asymptote to taps",
    "goes dark": "beam blocked",
    "light returns": "beam clear",
    "runs it was not fitted to": "cross-validated",
    "I choose my own": "Use my own instruments",
    "the ruler says": "Measured length",
    "Left over, 20 times as long": "Residuals ×",
    "Start nevertheless?": "Start anyway?",
    "As the desktop": "System",
    "after its price": "",  # the gap's evidence is said otherwise today
}
REMOVED = re.compile("|".join(rf"\b{re.escape(words)}" for words in INSTEAD), re.IGNORECASE)
_KEYS = {"rivals"}  # names in JSON, which nobody reads as a sentence


def shown_by(file: Path) -> Iterator[str]:
    """Every text of a module but its docstrings; of a page's template, what is not code."""
    if file.suffix != ".py":
        yield re.sub(r"{%.*?%}|{{.*?}}", "", file.read_text("utf-8"), flags=re.DOTALL)
        return
    tree = ast.parse(file.read_text("utf-8"))
    said = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in said:
            yield node.value


def sources() -> list[Path]:
    roots = [Path(package.__file__).parent for package in (draglag, draglag_app)]
    return [file for root in roots for kind in ("*.py", "*.html") for file in sorted(root.rglob(kind))]


def pages() -> list[Path]:
    manual = Path(str(resource("manual", "")))
    return [*sorted(manual.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md")), ROOT / "README.md"]


def removed_in(texts: Iterator[str]) -> list[str]:
    return [match[0] for text in texts if text not in _KEYS for match in REMOVED.finditer(re.sub(r"\s+", " ", text))]


def test_no_text_of_the_program_has_a_removed_name() -> None:
    found = {file.name: removed_in(shown_by(file)) for file in sources()}
    assert len(found) > 200
    assert {name: words for name, words in found.items() if words} == {}


@pytest.mark.parametrize("file", pages(), ids=lambda file: file.stem)
def test_no_page_to_read_has_a_removed_name(file: Path) -> None:
    assert removed_in(iter([file.read_text("utf-8")])) == []


def test_what_replaced_them_is_in_the_windows() -> None:
    shown = texts_of_windows()
    assert [name for name in INSTEAD.values() if not any(name in text for text in shown)] == []
