"""Nothing is cut off without showing the whole elsewhere."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QHelpEvent
from PySide6.QtWidgets import QApplication, QComboBox, QStyleOptionViewItem, QTableWidgetItem, QToolTip

from draglag_app.windows.parts.full_texts import ElidedBox, ElidedButton, ElidedLabel, WholeTexts, whole_text
from draglag_app.windows.parts.widgets import Shallow, label, table
from draglag_app.windows.window import OperatorWindow

LONG = "2026-11-21_152622_latency-sweep-with-a-name-that-nobody-foresaw-on-screen-1.h5"


def test_a_name_without_room_ends_in_dots_and_is_whole_in_its_tooltip(
    qapp: QApplication, open_window: Callable[..., OperatorWindow]
) -> None:
    window = open_window()
    window.resize(1280, 800)
    name = window.header.session
    name.setText("short")
    qapp.processEvents()
    assert (name.shown(), name.toolTip()) == ("short", "")
    name.setText(LONG * 3)
    qapp.processEvents()
    assert name.shown().endswith("…")
    assert name.toolTip() == name.text() == LONG * 3
    # The window is no wider for it.
    assert window.minimumSizeHint().width() <= 1280


def test_a_label_shows_the_whole_as_tooltip_as_soon_as_it_grows_narrow(qapp: QApplication) -> None:
    words = ElidedLabel()
    words.resize(900, 30)
    words.setText(LONG)
    words.show()
    qapp.processEvents()
    assert words.toolTip() == ""
    words.resize(120, 30)
    qapp.processEvents()
    assert words.toolTip() == LONG
    words.close()
    words.deleteLater()


def test_cells_that_are_cut_off_tell_the_whole(qapp: QApplication) -> None:
    rows = table(["what", "why"], stretch=1)
    rows.resize(400, 200)
    rows.setRowCount(1)
    rows.setItem(0, 0, QTableWidgetItem("run-01"))
    rows.setItem(0, 1, QTableWidgetItem(LONG))
    rows.show()
    qapp.processEvents()
    delegate = rows.itemDelegate()
    assert isinstance(delegate, WholeTexts)
    said = []
    for column in (0, 1):
        index, option = rows.model().index(0, column), QStyleOptionViewItem()
        rows.initViewItemOption(option)
        option.rect = rows.visualRect(index)
        QToolTip.hideText()
        event = QHelpEvent(QHelpEvent.Type.ToolTip, option.rect.center(), QPoint(10, 10))
        delegate.helpEvent(event, rows, option, index)
        said.append(delegate.is_cut_off(rows, option, index))
    assert said == [False, True]
    QToolTip.hideText()
    rows.close()
    rows.deleteLater()


def test_a_choice_wider_than_its_box_is_reported_and_its_list_is_wide_enough(qapp: QApplication) -> None:
    box = QComboBox()
    box.addItems(["constant", LONG])
    box.setFixedWidth(120)
    whole_text(box, "Shape of the curve")
    assert box.toolTip() == "Shape of the curve: constant"
    box.setCurrentIndex(1)
    assert box.toolTip() == f"Shape of the curve: {LONG}"
    assert box.view().minimumWidth() >= box.fontMetrics().horizontalAdvance(LONG)
    box.close()
    box.deleteLater()


def test_many_remarks_scroll_and_few_take_only_their_lines(qapp: QApplication) -> None:
    words = label("", "hint", wrap=True)
    area = Shallow(words, 84)
    area.resize(600, 84)
    area.show()
    area.show_text("One remark.")
    qapp.processEvents()
    one = area.height()
    assert 0 < one < 40
    assert area.verticalScrollBar().maximum() == 0
    # Words that are wrapped need no more than their lines either.
    area.show_text(" ".join(["remark"] * 40))
    qapp.processEvents()
    assert one < area.height() < 84
    assert area.verticalScrollBar().maximum() == 0
    area.show_text("\n".join(f"Remark {k}: {LONG}" for k in range(20)))
    qapp.processEvents()
    assert area.height() == 84
    assert area.verticalScrollBar().maximum() > 0
    area.show_text("")
    assert area.height() == 0
    area.close()
    area.deleteLater()


def of_kind(kind: str, text: str) -> ElidedBox | ElidedButton:
    box = ElidedBox(12)
    box.addItem(text)
    made = ElidedButton(text) if kind == "button" else box
    made.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # which would be drawn
    return made


@pytest.mark.parametrize("kind", ["button", "box"])
def test_a_button_or_choice_without_room_ends_in_dots(qapp: QApplication, kind: str) -> None:
    made = of_kind(kind, LONG)
    made.show()
    for wide, whole in ((1200, True), (200, False)):
        made.resize(wide, 44)
        qapp.processEvents()
        shown = made.shown()
        assert (shown == LONG) is whole
        assert shown.endswith("…") is not whole
        same = of_kind(kind, shown)  # painted as a text that has the room it needs
        same.resize(wide, 44)
        assert made.grab().toImage() == same.grab().toImage()
        same.deleteLater()
    assert (made.text() if kind == "button" else made.currentText()) == LONG
    made.close()
    made.deleteLater()


def test_steps_without_room_end_in_dots(open_window: Callable[..., OperatorWindow], qapp: QApplication) -> None:
    window = open_window(rig={"touch": "sim:", "laser": "", "walt": ""}, text_scale=1.5)
    window.go("record")
    for size, whole in (((1920, 1080), True), ((853, 533), False)):
        window.resize(*size)
        qapp.processEvents()
        step = window.steps.buttons["bench"]
        assert (step.shown() == step.text()) is whole
        assert step.toolTip() == step.text()
