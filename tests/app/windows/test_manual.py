"""The manual, which is all that a new operator has."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from PySide6.QtGui import QImage, QTextCursor
from PySide6.QtWidgets import QApplication, QListWidget, QPushButton

from draglag_app.windows.actions import ACTIONS
from draglag_app.windows.pages.help import HelpPage, manual_text
from draglag_app.windows.window import OperatorWindow
from draglag_app.windows.wording.i18n import table_of, use_language
from draglag_resources import resource


def test_the_manual_describes_what_the_window_can_do_by_the_names_it_has_there(open_window: Callable) -> None:
    window = open_window()
    window.pages.make_all()
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


def sections_of(language: str) -> dict[str, str]:
    """Title → text, in order."""
    _, *parts = re.split(r"^## ", manual_text(language), flags=re.MULTILINE)
    return {title.strip(): text for title, _, text in (part.partition("\n") for part in parts)}


def bones(text: str) -> dict[str, list[str]]:
    """What does not depend on the language: pictures, keys, values to type, and how many items a list has."""
    return {
        "pictures": re.findall(r"\((pictures/\w+\.png)\)", text),
        "keys": sorted(set(re.findall(r"\*\*((?:Ctrl\+)?(?:Shift\+)?(?:F\d|[A-Z.]))\*\*", text))),
        "code": sorted(set(re.findall(r"`(?:draglag|\?|packaging)[^`]*`", text))),
        "items": re.findall(r"^(-|\d\.) ", text, flags=re.MULTILINE),
    }


def test_both_manuals_have_the_same_sections_in_the_same_order(open_window: Callable) -> None:
    english, dutch = sections_of("en"), sections_of("nl")
    words = table_of("nl")
    assert len(english) == len(dutch) >= 14
    titles = {title for title, _ in open_window().pages.values()} - {"Help"}
    for (title, text), (in_dutch, text_in_dutch) in zip(english.items(), dutch.items(), strict=True):
        assert bones(text) == bones(text_in_dutch), title
        assert text.strip(), title
        if title in titles:
            assert in_dutch == words[title]
        else:
            assert in_dutch != title
    assert titles <= set(english)


def in_sight(page: HelpPage, title: str) -> bool:
    """Whether the section's heading is the first line, or in sight with the end of the manual below it."""
    manual = page.manual
    bar, cursor = manual.verticalScrollBar(), QTextCursor(manual.document())
    block = manual.document().begin()
    while block.isValid() and not (block.blockFormat().headingLevel() == 2 and block.text() == title):
        block = block.next()
    cursor.setPosition(block.position())
    top = manual.cursorRect(cursor).top()
    return 0 <= top < 40 or (bar.value() == bar.maximum() and 0 <= top < manual.viewport().height() - 40)


@pytest.fixture(params=["en", "nl"])
def translated(request: pytest.FixtureRequest, open_window: Callable, qapp: QApplication) -> Iterator[OperatorWindow]:
    """A window in each language."""
    window = open_window(language=request.param)
    window.resize(1280, 800)
    yield window
    use_language(qapp, "en")


def test_every_entry_of_the_contents_leads_to_its_section(translated: OperatorWindow, qapp: QApplication) -> None:
    translated.go("help")
    page = translated.pages["help"][1]
    entries = [page.contents.item(k) for k in range(page.contents.count())]
    assert [entry.text() for entry in entries] == list(sections_of(translated.space.settings.language))
    for entry in (*entries[1:], entries[0]):
        page.contents.setCurrentItem(entry)
        qapp.processEvents()
        assert in_sight(page, entry.text()), entry.text()


def test_the_question_mark_of_every_page_opens_its_section(translated: OperatorWindow, qapp: QApplication) -> None:
    page = translated.pages["help"][1]
    for name, (title, _) in translated.pages.items():
        if name != "help":
            translated.go(name)
            translated.header.help.click()
            qapp.processEvents()
            assert translated.page == "help"
            assert in_sight(page, title), title


def ink(contents: QListWidget) -> list[int]:
    """How many pixels each entry's letters take."""
    drawn = contents.viewport().grab().toImage()
    ground = drawn.pixel(0, drawn.height() - 1)
    places = [contents.visualItemRect(contents.item(k)) for k in range(contents.count())]
    return [
        sum(drawn.pixel(x, y) != ground for x in range(at.left(), at.right()) for y in range(at.top(), at.bottom()))
        for at in places
    ]


def test_titles_in_the_contents_are_whole(translated: OperatorWindow, qapp: QApplication) -> None:
    """As many letters are drawn in two lines as in one that has room for all."""
    translated.go("help")
    qapp.processEvents()
    contents = translated.pages["help"][1].contents
    drawn = ink(contents)
    contents.setFixedWidth(2 * contents.width())
    qapp.processEvents()
    assert drawn == pytest.approx(ink(contents), rel=0.03)  # letters begin at other fractions of a pixel
