"""Small windows and large text: the navigation gives way, and scrolling reaches every control of every page, whole."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QAbstractSpinBox,
    QApplication,
    QComboBox,
    QLineEdit,
    QScrollArea,
    QTabBar,
    QWidget,
)

from draglag_app.windows.parts.page_stack import PageScroll
from draglag_app.windows.parts.theme import apply_theme
from draglag_app.windows.plots.plot import Plot
from draglag_app.windows.window import OperatorWindow

_CONTROLS = (
    QAbstractButton, QLineEdit, QComboBox, QAbstractSpinBox, QAbstractItemView, QTabBar, Plot,
)  # fmt: skip


def at_size(window: OperatorWindow, size: tuple[int, int], page: str) -> None:
    window.resize(*size)
    window.go(page)
    for _ in range(5):
        QApplication.processEvents()
    assert (window.width(), window.height()) == size, page


def test_a_narrow_window_shows_the_pages_icons_alone(open_window: Callable[..., OperatorWindow]) -> None:
    window = open_window()
    at_size(window, (1280, 800), "record")
    tabs = window.navigation.tabs
    titles = {name: tab.text() for name, tab in tabs.items()}
    assert titles == {name: title for name, (title, _) in window.pages.items()}
    wide = window.navigation.width()
    at_size(window, (960, 540), "record")
    assert {tab.text() for tab in tabs.values()} == {""}
    assert window.navigation.width() < wide / 2
    for name, tab in tabs.items():
        assert not tab.icon().isNull()
        assert titles[name] in tab.toolTip()
        tab.click()
        assert window.page == name
    at_size(window, (1280, 800), "record")
    assert {name: tab.text() for name, tab in tabs.items()} == titles


def bring_into_sight(control: QWidget) -> list[QScrollArea]:
    """Scroll everything around a control to it."""
    areas, inner = [], control.parentWidget()
    while inner is not None:
        if isinstance(inner, QScrollArea):  # of a field, ensureWidgetVisible shows the cursor alone
            middle = control.mapTo(inner.widget(), control.rect().center())
            inner.ensureVisible(middle.x(), middle.y(), control.width() // 2 + 1, control.height() // 2 + 1)
            areas.append(inner)
        inner = inner.parentWidget()
    QApplication.processEvents()
    return areas


def controls_of(page: QWidget) -> list[QWidget]:
    """All but the parts of other controls: of fields, of tables and of plots."""
    seen = [one for one in page.findChildren(QWidget) if isinstance(one, _CONTROLS) and one.isVisible()]
    return [one for one in seen if not any(other.isAncestorOf(one) for other in seen if other is not one)]


def not_reached(control: QWidget) -> str:
    """What of a control is not shown however one scrolls; empty if nothing."""
    areas = bring_into_sight(control)
    seen, least = control.visibleRegion().boundingRect(), control.minimumSizeHint()
    room = min((area.viewport().size() for area in areas), key=lambda size: size.height(), default=control.size())
    wanted = control.size().boundedTo(room)  # what is larger than the window is scrolled on
    if isinstance(control, QAbstractItemView | Plot):
        seen = (control.viewport().visibleRegion().boundingRect()).united(seen)
    if seen.width() < wanted.width() or seen.height() < wanted.height():
        return f"shows {seen.width()} × {seen.height()} of {wanted.width()} × {wanted.height()}"
    if control.width() < least.width() or control.height() < least.height():
        return f"is {control.width()} × {control.height()}, needs {least.width()} × {least.height()}"
    return ""


@pytest.fixture
def scaled(
    open_window: Callable[..., OperatorWindow], qapp: QApplication, show_session: Callable
) -> Iterator[Callable[[float], OperatorWindow]]:
    """A window with text of a size, and a session."""

    def make(scale: float) -> OperatorWindow:
        window = open_window(text_scale=scale)
        show_session(window)
        return window

    yield make
    apply_theme(qapp, "dark", 1.0)


@pytest.mark.parametrize(("size", "scale"), [((960, 540), 1.0), ((1280, 800), 1.5), ((1280, 800), 2.0)])
def test_scrolling_reaches_every_control_whole(
    scaled: Callable[[float], OperatorWindow], size: tuple[int, int], scale: float
) -> None:
    window, missed, scrolled = scaled(scale), [], []
    (outer,) = window.findChildren(PageScroll)
    for name in (*window.pages, "record"):
        window.record.set_recording(len(scrolled) == len(window.pages))  # in the end with the buttons of a session
        at_size(window, size, name)
        scrolled.append(outer.verticalScrollBar().isVisible())
        known = controls_of(window.pages[name][1])
        assert known, name
        for control in known:
            text = getattr(control, "text", control.accessibleName)() or control.accessibleName()
            missed += [(name, type(control).__name__, text, found)] if (found := not_reached(control)) else []
    window.record.set_recording(False)
    assert missed == [], "\n".join(map(str, missed))
    assert any(scrolled)
