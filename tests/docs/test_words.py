"""The check of words: banned ones are found in names, comments and docstrings, and messages are left alone."""

from __future__ import annotations

import importlib.util
from pathlib import Path

ROOT = Path(__file__).parents[2]
SOURCE = '''"""Values as
they came."""
untold_events = 1  # heard anew
message = f"it was told {untold_events}"
behold = "anew"
'''


def test_banned_words_are_found_in_names_comments_and_docstrings_alone() -> None:
    spec = importlib.util.spec_from_file_location("words", ROOT / "tests/docs/words.py")
    assert spec is not None
    assert spec.loader is not None
    words = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(words)
    pattern = words.banned((ROOT / "docs/glossary.md").read_text("utf-8"))
    found = [(line, word.lower()) for line, word in words.findings(SOURCE, pattern)]
    assert found == [(1, "as they came"), (3, "untold"), (3, "anew")]
