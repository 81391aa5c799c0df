"""What the library says at a terminal with commands, the windows say with their buttons and pages."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from PySide6.QtWidgets import QApplication

from draglag_app.cli.main import COMMANDS
from draglag_app.windows.wording.button_words import IN_BUTTONS
from draglag_app.windows.wording.i18n import use_language
from draglag_app.windows.wording.library_words import in_words
from message_templates import example, sentences

_COMMAND = re.compile(rf"draglag (?:{'|'.join(COMMANDS)})\b|(?<![\w-])--[a-z]")
# What no window asks the library for: recordings of other programs, models read from files, the paper's figures, what
# is computed on other computers.
_NEVER = (
    "exchange/importers", "model/file", "draglag/reproduction", "draglag_app/cli", "draglag_app/lsl",
    "draglag_app/parallel",
)  # fmt: skip
# An unknown form cannot be chosen in a window; the options of a rig are those that the page Bench offers.
_NO_SENTENCE = {"See draglag analyze --help", "add {options}"}


def with_commands() -> list[str]:
    """Every template that names a command or an option and may reach a window."""
    found = {s.template for s in sentences() if s.template and not any(part in s.file for part in _NEVER)}
    return sorted(text for text in found - _NO_SENTENCE if _COMMAND.search(text))


@pytest.mark.parametrize("language", ["en", "nl"])
def test_no_sentence_in_a_window_names_a_command(qapp: QApplication, language: str) -> None:
    known = [example(template) for template in with_commands()]
    assert len(known) > 15
    try:
        use_language(qapp, language)
        shown = [in_words(text) for text in known]
    finally:
        use_language(qapp, "en")
    assert [text for text in shown if _COMMAND.search(text)] == []
    assert not set(shown) & {str(text) for text in known}


def test_only_templates_of_the_sources_have_other_words_in_the_windows() -> None:
    assert set(IN_BUTTONS) - {sentence.template for sentence in sentences()} == set()


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
