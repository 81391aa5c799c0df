"""Every text of the windows is translated, with the same places for numbers."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from PySide6.QtCore import QCoreApplication
from PySide6.QtGui import QKeySequence
from PySide6.QtWidgets import QApplication

import draglag_app.windows
from draglag.curve import FORMS
from draglag.latency.flags import MEANING
from draglag_app.windows.i18n import language_of, table_of, use_language

LANGUAGES = ("nl",)
_MARKS = {"tr": 0, "translate": 1, "QT_TRANSLATE_NOOP": 1, "say": 1}


def texts() -> set[str]:
    """Every string that the windows pass to a translating function."""
    found = set()
    for file in Path(draglag_app.windows.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
            if not isinstance(node, ast.Call):
                continue
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            place = _MARKS.get(name)
            if place is None:
                continue
            for argument in node.args[min(place, len(node.args) - 1) :][:1]:
                if isinstance(argument, ast.Constant) and isinstance(argument.value, str) and argument.value.strip():
                    found.add(argument.value)
    found |= {form.title for form in FORMS.values()} | set(MEANING.values())
    return found | {flag.replace("_", " ") for flag in MEANING}


@pytest.mark.parametrize("language", LANGUAGES)
def test_translation_is_whole(language: str) -> None:
    table = table_of(language)
    assert sorted(texts() - set(table)) == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_places_for_numbers_are_the_same(language: str) -> None:
    for text, translated in table_of(language).items():
        assert set(re.findall(r"{\w+", text)) == set(re.findall(r"{\w+", translated)), text


def test_windows_speak_dutch(qapp: QApplication, open_window: Callable) -> None:
    try:
        window = open_window(language="nl")
        assert window.tabs["record"].text() == table_of("nl")["Record"]
        assert window.actions_table.made["start"].text() == table_of("nl")["Start measuring"]
        assert (
            window.actions_table.made["go_bench"].shortcut().toString(QKeySequence.SequenceFormat.NativeText)
            == "Ctrl+1"
        )
        assert QCoreApplication.translate("QFileDialog", "A text of Qt's own") == "A text of Qt's own"
        assert "laserstraal" in window.pages["help"][1].manual.toPlainText()
    finally:
        use_language(qapp, "en")


def test_unknown_languages_are_english() -> None:
    assert language_of("xx") == "en"
    assert table_of("xx") == {}
