"""Sizes for a finger, and for small screens."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QAbstractScrollArea,
    QAbstractSpinBox,
    QApplication,
    QCheckBox,
    QComboBox,
    QGraphicsView,
    QLineEdit,
    QMenu,
    QPushButton,
    QScrollArea,
    QScroller,
    QTabBar,
    QTableWidget,
)

from draglag_app.windows.wording.i18n import use_language


def test_everything_to_press_or_fill_in_is_large_enough_for_a_finger(open_window: Callable) -> None:
    window = open_window()
    for name in window.pages:
        window.go(name)
        QApplication.processEvents()
        for kind in (QPushButton, QComboBox, QAbstractSpinBox, QLineEdit, QCheckBox, QTabBar):
            for widget in window.findChildren(kind):
                if widget.isVisible() and not isinstance(widget.parent(), QAbstractSpinBox | QComboBox):
                    assert widget.height() >= 44, (name, kind.__name__, widget.accessibleName())
        for rows in window.findChildren(QTableWidget):
            assert rows.verticalHeader().defaultSectionSize() >= 44, (name, rows.accessibleName())


def test_lists_that_drop_down_have_rows_for_a_finger(open_window: Callable) -> None:
    window = open_window()
    window.pages.make_all()
    window.ask("details")
    QApplication.processEvents()
    for box in window.findChildren(QComboBox):
        if box.count():
            box.view().ensurePolished()
            assert box.view().sizeHintForRow(0) >= 44, box.accessibleName()


def test_a_finger_scrolls_pages_and_lists_and_moves_plots(open_window: Callable) -> None:
    window = open_window()
    window.pages.make_all()
    areas = window.findChildren(QAbstractScrollArea)
    plots = [area for area in areas if isinstance(area, QGraphicsView)]
    others = [area for area in areas if not isinstance(area, QGraphicsView)]
    assert plots
    assert others
    assert all(QScroller.hasScroller(area.viewport()) for area in others)
    assert not any(QScroller.hasScroller(area.viewport()) for area in plots)


def test_menus_are_large_enough_for_a_finger(open_window: Callable) -> None:
    bar = open_window().menuBar()
    assert all(bar.actionGeometry(title).height() >= 44 for title in bar.actions())
    menus = [menu for menu in bar.findChildren(QMenu) if menu.title()]  # not the one of what finds no room
    assert len(menus) == len(bar.actions()) + 1  # that of sessions opened last is in another
    for menu in menus:
        menu.ensurePolished()
        assert all(menu.actionGeometry(item).height() >= 44 for item in menu.actions())


@pytest.mark.parametrize("language", ["en", "nl"])
def test_every_page_fits_a_small_screen_also_with_a_notice(
    qapp: QApplication, open_window: Callable, language: str
) -> None:
    try:
        window = open_window(language=language)
        window.notify("error", "What happened, and what to do about it. " * 4)
        for name in window.pages:
            window.go(name)
            QApplication.processEvents()
            needed = window.minimumSizeHint()
            assert (needed.width() <= 1280, needed.height() <= 800) == (True, True), (name, needed)
        # What does not fit into the height scrolls, and the keyboard's focus takes it along.
        window.resize(1280, needed.height())
        window.go("protocol")
        last = window.pages["protocol"][1].form.taps
        last.setFocus(Qt.FocusReason.TabFocusReason)
        area = next(area for area in window.pages["protocol"][1].findChildren(QScrollArea) if area.isAncestorOf(last))
        area.ensureWidgetVisible(last)
        QApplication.processEvents()
        assert area.viewport().rect().contains(last.mapTo(area.viewport(), last.rect().center()))
    finally:
        use_language(qapp, "en")
