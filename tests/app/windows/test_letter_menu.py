"""Menus whose entries are chosen by typing how they begin."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from draglag_app.windows.parts.letter_menu import LetterMenu

NAMES = ("clock-check", "demo", "latency-sweep", "taps-100", "late")
Key = Qt.Key


@pytest.fixture
def menu(qapp: QApplication) -> Iterator[LetterMenu]:
    before_ms = qapp.keyboardInputInterval()
    qapp.setKeyboardInputInterval(60_000)  # however slow the machine: what is typed here is typed in one go
    made = LetterMenu()
    for name in NAMES:
        made.addAction(name)
    made.popup(made.pos())
    yield made
    made.close()
    made.deleteLater()
    qapp.setKeyboardInputInterval(before_ms)


def present(menu: LetterMenu) -> str:
    action = menu.activeAction()
    return "" if action is None else action.text()


def test_letters_go_to_what_begins_so_and_return_takes_it(menu: LetterMenu) -> None:
    taken: list[str] = []
    menu.triggered.connect(lambda action: taken.append(action.text()))
    QTest.keyClicks(menu, "t")
    assert present(menu) == "taps-100"
    QTest.keyClick(menu, Key.Key_Return)
    assert taken == ["taps-100"]


def test_several_letters_are_read_together_in_any_case(menu: LetterMenu) -> None:
    QTest.keyClicks(menu, "late")
    assert present(menu) == "latency-sweep"
    menu.setActiveAction(menu.actions()[4])
    assert present(menu) == "late"


def test_the_same_letter_again_goes_on_to_the_next(menu: LetterMenu) -> None:
    seen = []
    for _ in range(3):
        QTest.keyClicks(menu, "L")
        seen.append(present(menu))
    assert seen == ["latency-sweep", "late", "latency-sweep"]


def test_what_cannot_be_chosen_is_passed_over_and_what_is_not_there_changes_nothing(menu: LetterMenu) -> None:
    menu.actions()[2].setEnabled(False)
    QTest.keyClicks(menu, "l")
    assert present(menu) == "late"
    QTest.keyClicks(menu, "x")
    assert present(menu) == "late"


def test_arrows_stay_the_menus(menu: LetterMenu) -> None:
    QTest.keyClicks(menu, "d")
    QTest.keyClick(menu, Key.Key_Down)
    assert present(menu) == "latency-sweep"


def test_menus_of_the_window_are_such(open_window: Callable) -> None:
    window = open_window()
    page = window.pages["protocol"][1]
    assert isinstance(page.preset.menu(), LetterMenu)
    bar = [action.menu() for action in window.menuBar().actions()]
    assert bar
    assert all(isinstance(menu, LetterMenu) for menu in bar)
