"""A first measurement as a new user makes it with only the manual at hand, and only a keyboard."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from PySide6.QtCore import Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractSpinBox, QApplication, QComboBox, QInputDialog, QLineEdit, QWidget

from draglag_app.windows.pages.help import manual_text
from draglag_app.windows.window import OperatorWindow

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


def in_menu(position: int) -> None:
    """What to press in the menu that is about to open."""
    QTimer.singleShot(0, lambda: choose(QApplication.activePopupWidget(), position))


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
    names = [action.text() for action in page.preset.menu().actions()]
    in_menu(names.index("demo"))
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


def test_a_run_is_left_out_and_taken_in_again(opened: OperatorWindow, until: Callable) -> None:
    window = opened
    come_back(window, until)
    press(window, Key.Key_5, control=True)
    page = window.pages["results"][1]
    tab_to(window, page.table)
    press(window, Key.Key_Home)
    press(window, Key.Key_Down)
    tab_to(window, page.leave_out)

    def answer() -> None:
        dialog = QApplication.activeModalWidget()
        assert isinstance(dialog, QInputDialog)
        QTest.keyClicks(dialog.findChild(QLineEdit), "slipped")
        QTest.keyClick(dialog, Key.Key_Return)

    QTimer.singleShot(0, answer)
    press(window, Key.Key_Space)
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
