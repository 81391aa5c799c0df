"""What the library says at a terminal with commands, the windows say with their buttons and pages."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from PySide6.QtWidgets import QApplication

import draglag
import draglag_app
import draglag_devices
from draglag_app.cli.main import COMMANDS
from draglag_app.windows.wording.i18n import use_language
from draglag_app.windows.wording.library_words import in_words

_COMMAND = re.compile(rf"draglag (?:{'|'.join(COMMANDS)})\b|(?<![\w-])--[a-z]")
# What no window asks the library for: recordings of other programs, models read from files, the paper's figures, what
# is computed on other computers. And what is no sentence: style sheets, arguments of helpers, names of columns.
_NEVER = (
    "exchange/importers", "model/file", "reproduction", "draglag_app/cli", "draglag_app/lsl", "draglag_app/parallel",
    "drawing/style", "ethercat_laser/master", "ethercat_laser/source", "store/schema", "report/gap", "windows/wording",
)  # fmt: skip
# An unknown form cannot be chosen in a window; a helper's option; the Gap page has its own words for the law.
_NO_SENTENCE = ("See draglag analyze --help", "--probe", "The curve is not Eq. 5")


def sentences() -> list[str]:
    """Every text outside docstrings that names a command or an option and may reach a window; X7 for what is put in."""
    found = []
    for package in (draglag, draglag_devices, draglag_app):
        for file in sorted(Path(package.__file__).parent.rglob("*.py")):
            if any(part in file.as_posix() for part in _NEVER):
                continue
            tree = ast.parse(file.read_text("utf-8"))
            nodes = list(ast.walk(tree))
            inner = {id(one.value) for one in nodes if isinstance(one, ast.Expr)}
            inner |= {id(part) for one in nodes if isinstance(one, ast.JoinedStr) for part in one.values}
            for node in nodes:
                if id(node) in inner or not isinstance(node, ast.Constant | ast.JoinedStr):
                    continue
                parts = node.values if isinstance(node, ast.JoinedStr) else [node]
                text = "".join(str(part.value) if isinstance(part, ast.Constant) else "X7" for part in parts)
                found += [text] if _COMMAND.search(text) else []
    begin = "X7 sends events that are no touch (X7), and nothing is recorded of them. "
    whole = [text.replace("run X7.", "run X7 ppm fast.").replace("X7Choose", f"{begin}Choose") for text in found]
    return [text for text in whole if not text.startswith(_NO_SENTENCE)]


@pytest.mark.parametrize("language", ["en", "nl"])
def test_no_sentence_in_a_window_names_a_command(qapp: QApplication, language: str) -> None:
    known = sentences()
    assert len(known) > 15
    try:
        use_language(qapp, language)
        shown = [in_words(text) for text in known]
    finally:
        use_language(qapp, "en")
    assert [text for text in shown if _COMMAND.search(text)] == []
    assert not set(shown) & set(known)


def test_a_damaged_file_is_said_without_a_command(
    open_window: Callable, until: Callable, session_file: Path, tmp_path: Path
) -> None:
    window = open_window()
    damaged = tmp_path / "damaged.h5"
    data = bytearray(session_file.read_bytes())
    middle = slice(len(data) // 4, len(data) // 4 * 3)
    data[middle] = bytes(middle.stop - middle.start)
    damaged.write_bytes(data)
    window.open_file(damaged)
    until(lambda: bool(window.notice_text.text()) and not window.space.tasks.running)
    assert "damaged.h5" in window.notice_text.text()
    assert not _COMMAND.search(window.notice_text.text())
    assert "copy of the file" in window.notice_text.text()
