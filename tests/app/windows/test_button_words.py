"""What the library says at a terminal with commands, the windows say with their buttons and pages."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from PySide6.QtWidgets import QApplication

from draglag.messages import Message
from draglag_app.windows.wording.button_words import IN_BUTTONS
from draglag_app.windows.wording.i18n import table_of, use_language
from draglag_app.windows.wording.library_words import in_words
from message_templates import example, sentences, shell_command, texts_of_windows

# What no window asks the library for: recordings of other programs, models read from files, the paper's figures, what
# is computed on other computers.
_NEVER = (
    "exchange/importers", "model/file", "draglag/reproduction", "draglag_app/cli", "draglag_app/lsl",
    "draglag_app/parallel",
)  # fmt: skip
# An unknown form cannot be chosen in a window; the options of a rig are those that the page Bench offers.
_NO_SENTENCE = {"See draglag analyze --help", "add {options}"}
_ADMINISTRATORS = re.compile("administrator|beheerder")


def with_commands() -> list[str]:
    """Every template that names a command or an option, or has a place for one, and may reach a window."""
    found = {s.template for s in sentences() if s.template and not any(part in s.file for part in _NEVER)}
    return sorted(text for text in found - _NO_SENTENCE if shell_command(text) or "{command}" in text)


def filled_in(template: str) -> Message:
    """An example with a command where the template has a place for one."""
    made = example(template)
    return Message(
        template, {**made.arguments, **({"command": "sudo something"} if "command" in made.arguments else {})}
    )


@pytest.mark.parametrize(("language", "administrator"), [("en", "administrator"), ("nl", "beheerder")])
def test_no_sentence_in_a_window_names_a_command_but_an_administrators(
    qapp: QApplication, language: str, administrator: str
) -> None:
    known = [filled_in(template) for template in with_commands()]
    assert len(known) > 25
    try:
        use_language(qapp, language)
        shown = [in_words(text) for text in known]
    finally:
        use_language(qapp, "en")
    assert [text for text in shown if shell_command(text) and administrator not in text] == []
    others = [text for text in shown if administrator not in text]
    assert len(others) > 15
    assert not set(others) & {str(text) for text in known}


@pytest.mark.parametrize("language", ["en", "nl"])
def test_no_text_of_the_windows_themselves_names_a_command(language: str) -> None:
    table = table_of(language)
    texts = texts_of_windows()
    assert len(texts) > 600
    shown = [table.get(text, text) for text in texts]
    assert [text for text in shown if shell_command(text) and not _ADMINISTRATORS.search(text)] == []


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
    assert not shell_command(window.notice_text.text())
    assert "copy of the file" in window.notice_text.text()
