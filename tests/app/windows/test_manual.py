"""The manual, which is all that a new operator has."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QApplication, QPushButton

from draglag_app.windows.actions import ACTIONS
from draglag_app.windows.pages.help import manual_text
from draglag_app.windows.wording.i18n import table_of
from draglag_resources import resource


def test_the_manual_describes_what_the_window_can_do_by_the_names_it_has_there(open_window: Callable) -> None:
    window = open_window()
    there = {one.text() for one in window.findChildren(QPushButton)}
    named = {
        "Look for devices", "Show the bar", "Correct", "Rotate 90°", "Save…", "Keep results", "Explain the gap",
        "Remove effect", "Add effect", "Save model…", "Add open session", "Add sessions…",
    }  # fmt: skip
    assert named <= there
    dutch = table_of("nl")
    assert [name for name in named if f"*{name}*" not in manual_text("en")] == []
    assert [name for name in named if f"*{dutch[name]}*" not in manual_text("nl")] == []
    keys = [
        spec.keys for spec in ACTIONS if spec.menu in ("session", "measure", "edit") and spec.id not in ("quit", "redo")
    ]
    for language in ("en", "nl"):
        assert [key for key in keys if key not in manual_text(language)] == []


def test_every_picture_of_the_manual_is_shown_as_wide_as_the_text(open_window: Callable, qapp: QApplication) -> None:
    window = open_window()
    window.go("help")
    manual = window.pages["help"][1].manual
    for width in (1280, 1920):
        window.resize(width, 800)
        qapp.processEvents()
        shown = manual.pictures()
        assert len(shown) == len(set(shown)) == 9
        for file, wide, high in shown:
            natural = QImage(file)
            assert not natural.isNull(), file
            assert 300 < wide <= min(manual.viewport().width(), natural.width()), file
            assert high / wide == pytest.approx(natural.height() / natural.width(), rel=0.01), file
        assert not manual.horizontalScrollBar().isVisible()
        document, block = manual.document(), manual.document().begin()
        while block.isValid():  # every word has its room between them
            assert document.documentLayout().blockBoundingRect(block).height() > 0, block.text()
            block = block.next()
        window.header.help.click()


def test_pictures_are_small_have_words_for_who_does_not_see_them_and_are_the_same_in_both_languages() -> None:
    named = {}
    for language in ("en", "nl"):
        pictures = re.findall(r"!\[(.*?)\]\((pictures/\w+\.png)\)", manual_text(language))
        assert all(len(alt) > 20 for alt, _ in pictures)
        named[language] = [file for _, file in pictures]
    assert named["en"] == named["nl"]
    folder = Path(str(resource("manual", "")))
    assert sorted(named["en"]) == sorted(f"pictures/{file.name}" for file in (folder / "pictures").iterdir())
    for file in named["en"]:
        assert (folder / file).stat().st_size < 60_000, file
