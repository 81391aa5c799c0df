"""A first measurement as a new user makes it with only the manual at hand, and only a keyboard."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from PySide6.QtCore import Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QAbstractSpinBox,
    QApplication,
    QComboBox,
    QFileDialog,
    QInputDialog,
    QLineEdit,
    QPushButton,
    QWidget,
)

from draglag_app.windows.pages.help import manual_text
from draglag_app.windows.window import OperatorWindow
from draglag_app.windows.wording.effect_words import effect_meaning

Key = Qt.Key


@pytest.fixture
def window(open_window: Callable, until: Callable) -> OperatorWindow:
    """As at the very first start: nothing chosen."""
    made = open_window(first_start=True, rig={})
    come_back(made, until)
    return made


def press(window: OperatorWindow, key: Qt.Key, control: bool = False) -> None:
    held = Qt.KeyboardModifier.ControlModifier if control else Qt.KeyboardModifier.NoModifier
    QTest.keyClick(QApplication.focusWidget() or window, key, held)
    QApplication.processEvents()


def tab_to(window: OperatorWindow, widget: QWidget) -> None:
    """Tab until the widget has the focus, as somebody would who looks for it."""
    for _ in range(60):
        if QApplication.focusWidget() is widget:
            return
        press(window, Key.Key_Tab)
    raise AssertionError(f"Tab never reaches {widget.accessibleName() or widget}")


def come_back(window: OperatorWindow, until: Callable) -> None:
    """A window manager would do this when a menu or a dialog closes; there is none off screen."""
    window.activateWindow()
    until(window.isActiveWindow)


def choose(menu: QWidget, position: int) -> None:
    """The entry of an open menu, counted from 0, by arrows and Return."""
    for _ in range(position + 1):
        QTest.keyClick(menu, Key.Key_Down)
    QTest.keyClick(menu, Key.Key_Return)


def by_letters(beginning: str) -> None:
    """What to type in the menu that is about to open."""

    def answer() -> None:
        menu = QApplication.activePopupWidget()
        QTest.keyClicks(menu, beginning)
        QTest.keyClick(menu, Key.Key_Return)

    QTimer.singleShot(0, answer)


def test_the_manuals_first_try(window: OperatorWindow, until: Callable) -> None:
    space = window.space
    for step in ("Use the simulated rig", "Simulated time, as fast as possible", "preset *demo*", "**F5**"):
        assert step in manual_text("en")
    tab_to(window, window.bench.use_simulated)
    press(window, Key.Key_Space)
    assert space.settings.rig.simulated
    tab_to(window, window.bench.fast)
    press(window, Key.Key_Space)
    assert space.settings.rig.fast

    press(window, Key.Key_3, control=True)
    page = window.pages["protocol"][1]
    tab_to(window, page.preset)
    by_letters("de")
    press(window, Key.Key_Space)
    until(lambda: space.protocol.name == "demo")
    assert space.settings.protocol == "demo"
    come_back(window, until)
    # Two of its tables are enough here: down to the third and out with the rest.
    while len(space.protocol.runs) > 2:
        tab_to(window, page.table)
        for _ in space.protocol.runs:
            press(window, Key.Key_Down)
        tab_to(window, page.remove)
        press(window, Key.Key_Space)
    tab_to(window, page.form.taps)
    page.form.taps.selectAll()
    QTest.keyClicks(page.form.taps, "0")
    press(window, Key.Key_Return)
    assert space.protocol.taps is None

    press(window, Key.Key_F5)
    assert space.recording.active
    until(lambda: space.analysis is not None and not space.tasks.running)
    assert window.stack.currentWidget() is window.pages["results"][1]
    assert space.analysis.curve is not None


def test_runs_are_put_in_another_order_and_shuffled(open_window: Callable, until: Callable) -> None:
    window = open_window()
    come_back(window, until)
    press(window, Key.Key_3, control=True)
    page, space = window.pages["protocol"][1], window.space
    first, second, *rest = space.protocol.runs
    down = next(one for one in page.findChildren(QPushButton) if one.accessibleName() == "Move down")
    tab_to(window, down)
    press(window, Key.Key_Space)
    assert space.protocol.runs == (second, first, *rest)
    press(window, Key.Key_Return)  # the button keeps the keyboard, and the run that moves stays chosen
    assert space.protocol.runs == (second, *rest, first)
    before = space.protocol.shuffle
    tab_to(window, page.form.shuffle)
    press(window, Key.Key_Space)
    assert space.protocol.shuffle is not before
    tab_to(window, page.form.seed)
    page.form.seed.selectAll()
    QTest.keyClicks(page.form.seed, "77")
    press(window, Key.Key_Return)
    assert space.protocol.seed == 77
    for _ in range(4):
        press(window, Key.Key_Z, control=True)
    assert space.protocol.runs == (first, second, *rest)
    assert space.protocol.shuffle is before


@pytest.mark.parametrize(("entry", "begins"), [("Save drawing (SVG)…", "<?xml"), ("Save numbers (CSV)…", "series,")])
def test_a_plot_is_saved(opened: OperatorWindow, until: Callable, tmp_path: Path, entry: str, begins: str) -> None:
    window = opened
    come_back(window, until)
    press(window, Key.Key_5, control=True)
    plot = window.pages["results"][1].curve
    tab_to(window, plot)
    assert plot._ring.isVisible()
    press(window, Key.Key_Return)
    menu = QApplication.activePopupWidget()
    names = [action.text() for action in menu.actions()]
    path = tmp_path / f"curve.{entry[-5:-2].lower()}"

    choose(menu, names.index(entry))
    until(lambda: window.findChild(QFileDialog) is not None)
    dialog = window.findChild(QFileDialog)
    dialog.setDirectory(str(tmp_path))
    field = dialog.findChild(QLineEdit, "fileNameEdit")
    field.selectAll()
    QTest.keyClicks(field, "curve")
    QTest.keyClick(field, Key.Key_Return)
    until(path.exists)
    assert path.read_text("utf-8").startswith(begins)
    assert window.notice_text.text() == f"Saved: {path}"
    come_back(window, until)
    assert QApplication.focusWidget() is plot
    assert plot._ring.isVisible()


def test_an_effect_is_added_to_the_gaps_model_and_taken_back(
    opened: OperatorWindow, until: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the library finds is made up; what the keyboard asks of it is not."""
    asked: list[tuple[str, ...]] = []

    def fake(function: object, arguments: tuple, progress: object) -> dict[str, object]:
        added = arguments[2]
        asked.append(added)
        steps = [
            {
                "effect": effect, "where": "", "parameters": {}, "gap_before_mm": 0.2, "gap_after_mm": 0.1,
                "evidence": {"p_value": 0.5, "text": "by hand"}, "indistinguishable_from": [],
                "probability": 0.5,
            }
            for effect in added
        ]  # fmt: skip
        return {
            "verdict": "no_gap", "steps": steps, "gap_first_mm": 0.2, "gap_last_mm": 0.1,
            "noise_floor_mm": 0.1, "report": ("report", added)
        }  # fmt: skip

    monkeypatch.setattr("draglag_app.windows.pages.gap.run_in_subprocess", fake)
    window = opened
    come_back(window, until)
    press(window, Key.Key_6, control=True)
    page = window.pages["gap"][1]

    def settle() -> None:
        until(lambda: not window.space.tasks.running)

    tab_to(window, page.explain_button)
    press(window, Key.Key_Return)
    settle()
    assert QApplication.focusWidget() is page.explain_button
    tab_to(window, page.choice)
    press(window, Key.Key_Down)
    effect = page.choice.currentData()
    assert effect_meaning(effect) in page.more.text()
    tab_to(window, page.add_button)
    press(window, Key.Key_Space)
    settle()
    assert asked == [(), (effect,)]
    assert page.table.rowCount() == 1
    assert page.table.item(0, 1).text() == "0.50"  # its probability
    assert QApplication.focusWidget() is page.add_button
    tab_to(window, page.table)
    press(window, Key.Key_Down)  # its only row
    tab_to(window, page.remove_button)
    press(window, Key.Key_Space)
    settle()
    assert page.table.rowCount() == 0
    press(window, Key.Key_Z, control=True)
    settle()
    assert page.table.rowCount() == 1


def test_a_run_is_excluded_and_included_again(opened: OperatorWindow, until: Callable) -> None:
    window = opened
    come_back(window, until)
    press(window, Key.Key_5, control=True)
    page = window.pages["results"][1]
    tab_to(window, page.table)
    press(window, Key.Key_Home)
    press(window, Key.Key_Down)
    tab_to(window, page.exclude_button)

    press(window, Key.Key_Space)
    dialog = QApplication.activeModalWidget()
    assert isinstance(dialog, QInputDialog)
    QTest.keyClicks(dialog.findChild(QLineEdit), "slipped")
    QTest.keyClick(dialog, Key.Key_Return)
    assert list(window.space.options.exclude.values()) == ["slipped"]
    come_back(window, until)
    press(window, Key.Key_Z, control=True)
    assert window.space.options.exclude == {}
    until(lambda: not window.space.tasks.running)


def test_tab_reaches_everything_and_everything_has_a_name(opened: OperatorWindow, until: Callable) -> None:
    window = opened
    come_back(window, until)
    for name, (_, page) in window.pages.items():
        window.go(name)
        QApplication.processEvents()
        wanted = [
            widget
            for widget in page.findChildren(QWidget)
            if widget.isVisible()
            and widget.isEnabled()
            and widget.focusPolicy() & Qt.FocusPolicy.TabFocus
            and type(widget) is not QWidget  # the insides of plots
            and widget.focusProxy() is None
            and not isinstance(widget.parent(), QAbstractSpinBox | QComboBox)
        ]
        reached = set()
        for _ in range(80):
            press(window, Key.Key_Tab)
            reached.add(QApplication.focusWidget())
        assert [widget for widget in wanted if widget not in reached] == [], name
        for widget in wanted:
            said = widget.accessibleName() or getattr(widget, "text", lambda: "")()
            assert said or "Tab" in type(widget).__name__, (name, widget)
