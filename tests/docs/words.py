"""Banned words of the glossary in names, comments and docstrings: ``python tests/docs/words.py``.

Exit code 1 and a line per finding. Messages are not searched: they are checked with their translations.
"""

from __future__ import annotations

import io
import re
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("core/draglag", "devices/draglag_devices", "app/draglag_app", "tests")
OWN_TEST = "tests/docs/test_words.py"  # which has the words as examples
DOCSTRING = re.compile(r"[rbuRBU]*(\"\"\"|''')")


def banned(glossary: str) -> re.Pattern[str]:
    """The first column of the table under "Not to be written", as one pattern of whole words."""
    table = glossary.partition("## Not to be written")[2]
    cells = [row.split("|")[1] for row in table.splitlines() if row.startswith("|") and "---" not in row]
    words = [word.strip() for cell in cells[1:] for word in cell.split(",")]
    return re.compile(rf"(?<![a-zA-Z])({'|'.join(map(re.escape, words))})(?![a-zA-Z])", re.IGNORECASE)


def findings(source: str, pattern: re.Pattern[str]) -> Iterator[tuple[int, str]]:
    """(line, word) for every banned word in a name, a comment or a docstring of a module."""
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        said = token.type in (tokenize.NAME, tokenize.COMMENT)
        if not said and not (token.type == tokenize.STRING and DOCSTRING.match(token.string)):
            continue
        text = re.sub(r"\s+", " ", token.string.replace("_", " "))
        yield from ((token.start[0], match[0]) for match in pattern.finditer(text))


def main() -> int:
    """Print every finding in the code; 1 if there is any."""
    pattern, count = banned((ROOT / "docs/glossary.md").read_text("utf-8")), 0
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*.py")):
            name = path.relative_to(ROOT).as_posix()
            if name == OWN_TEST:
                continue
            for line, word in findings(path.read_text("utf-8"), pattern):
                print(f"{name}:{line}: {word!r} is banned by docs/glossary.md")
                count += 1
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
