"""With text at 150 % everything is still there on a small screen, and at 200 % on a large one."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest
from PySide6.QtCore import QPoint
from PySide6.QtWidgets import QApplication, QLabel, QPushButton, QTableWidgetItem, QVBoxLayout, QWidget

from draglag_app.windows.main import _AROUND_PX
from draglag_app.windows.parts.flow import Flow
from draglag_app.windows.parts.full_texts import ElidedLabel
from draglag_app.windows.parts.page_stack import PageScroll
from draglag_app.windows.parts.theme import apply_theme
from draglag_app.windows.window import OperatorWindow
from draglag_app.windows.wording.i18n import use_language


@pytest.fixture(params=["en", "nl"])
def large(qapp: QApplication, open_window: Callable, request: pytest.FixtureRequest) -> object:
    yield open_window(language=request.param, text_scale=1.5)
    use_language(qapp, "en")
    apply_theme(qapp, "dark", 1.0)


def test_every_page_fits_a_small_screen_with_large_text(large: OperatorWindow, qapp: QApplication) -> None:
    large.notify("error", "What happened, and what to do about it. " * 2)
    for recording in (True, False):
        large.record.set_recording(recording)
        for name in large.pages:
            large.go(name)
            large.resize(1280, 800)
            qapp.processEvents()
            assert (large.width(), large.height()) == (1280, 800), (name, recording)
            page = large.pages[name][1]
            for seen in page.findChildren(QPushButton):
                if seen.isVisible():
                    left = seen.mapTo(page, QPoint(0, 0)).x()  # up and down, some pages scroll
                    assert left >= 0, (name, seen.text())
                    assert left + seen.width() <= page.width(), (name, seen.text())
                    assert seen.width() >= seen.minimumSizeHint().width(), (name, seen.text())


@pytest.mark.parametrize("recording", [False, True])
@pytest.mark.parametrize("language", ["en", "nl"])
def test_at_200_percent_buttons_and_labels_are_whole_or_the_page_scrolls(
    open_window: Callable, qapp: QApplication, show_session: Callable, language: str, recording: bool
) -> None:
    """With a session at hand, and while another is recorded."""
    cut: list[tuple[str, str, int, int]] = []
    try:
        window = open_window(language=language, text_scale=2.0)
        window.record.set_recording(recording)
        if not recording:
            show_session(window)
        (scroll,) = window.findChildren(PageScroll)
        for name, (_, page) in window.pages.items():
            window.go(name)
            window.resize(1920, 1080)
            for _ in range(3):
                qapp.processEvents()
            assert (window.width(), window.height()) == (1920, 1080), name
            assert page.width() <= scroll.viewport().width() or scroll.horizontalScrollBar().isVisible(), name
            for seen in window.findChildren(QWidget):
                if isinstance(seen, QPushButton | QLabel) and seen.isVisible() and seen.text():
                    cut += [(name, *one) for one in [(seen.text(), seen.width(), needed(seen))] if one[1] < one[2]]
                    if page.isAncestorOf(seen):
                        left = seen.mapTo(page, QPoint(0, 0)).x()
                        assert -1 <= left <= page.width() - seen.width() + 1, (name, seen.text())
    finally:
        use_language(qapp, "en")
        apply_theme(qapp, "dark", 1.0)
    assert cut == []


def needed(seen: QPushButton | QLabel) -> int:
    """The least width at which all can be read: words wrap, elided text is whole in the tooltip."""
    if isinstance(seen, ElidedLabel):
        return 0 if seen.toolTip() else seen.fontMetrics().horizontalAdvance(seen.text())
    if isinstance(seen, QLabel) and seen.wordWrap():
        return max(map(seen.fontMetrics().horizontalAdvance, re.split(r"\s+", re.sub("<[^>]*>", "", seen.text()))))
    return seen.sizeHint().width()


@pytest.mark.parametrize("page", ["results", "record"])
def test_latency_and_verdict_are_whole(large: OperatorWindow, qapp: QApplication, page: str) -> None:
    table = large.pages[page][1].table
    table.insertRow(0)
    for column, text in enumerate(("run-12", "multi-sine", "1000", "134.3 ± 11.7 ms", "1248 (+12)", "✓ good")):
        table.setItem(0, column, QTableWidgetItem(text))
    large.go(page)
    large.resize(1280, 800)
    qapp.processEvents()
    for column in (0, 3, 5):
        assert table.columnWidth(column) >= table.sizeHintForColumn(column)
        assert table.columnViewportPosition(column) + table.sizeHintForColumn(column) <= table.viewport().width()


def test_the_choices_and_the_first_runs_of_results_are_in_sight(
    large: OperatorWindow, qapp: QApplication, until: Callable, show_session: Callable
) -> None:
    show_session(large)
    large.go("results")
    large.resize(1280, 800 - _AROUND_PX[1])  # below a title bar
    until(lambda: large.stack.width() > 1000)
    for _ in range(5):
        qapp.processEvents()
    results = large.pages["results"][1]
    for box in (results.estimator, results.rate, results.form):
        assert box.shown() == box.currentText()
    table = results.table
    seen = table.viewport().visibleRegion().boundingRect()
    assert seen.height() >= table.rowViewportPosition(1) + table.rowHeight(1)


def test_the_protocols_plots_have_room(large: OperatorWindow, qapp: QApplication) -> None:
    large.go("protocol")
    large.resize(1280, 800)
    qapp.processEvents()
    page = large.pages["protocol"][1]
    for plot in (page.preview.plot, page.precision.plot):
        inside = plot.getPlotItem().vb.sceneBoundingRect()
        assert inside.height() >= 110, plot.file_name
        assert inside.width() >= 350, plot.file_name
        title = plot.getPlotItem().titleLabel.item.sceneBoundingRect()
        assert 0 <= title.left() < title.right() <= plot.width(), plot.file_name
    order, precision = (plot.mapTo(page, QPoint(0, 0)).y() for plot in (page.preview.plot, page.precision.plot))
    assert precision >= order + page.preview.plot.height()


def test_a_row_goes_on_in_the_next_line_and_its_right_part_stays_right(qapp: QApplication) -> None:
    window = QWidget()
    outer, row = QVBoxLayout(window), Flow(10)
    outer.setContentsMargins(0, 0, 0, 0)
    outer.addLayout(row)
    outer.addStretch(1)
    left, grows, right = QLabel("a"), QLabel("b"), QLabel("c")
    for one in (left, grows, right):
        one.setMinimumSize(100, 40)
    grows.setMaximumWidth(150)
    row.addWidget(left)
    row.add_growing(grows)
    row.add_rest()
    row.addWidget(right)
    window.resize(600, 200)
    window.show()
    qapp.processEvents()
    assert [one.geometry().getRect() for one in (left, grows, right)] == [
        (0, 0, 100, 40), (110, 0, 150, 40), (500, 0, 100, 40),
    ]  # fmt: skip
    window.resize(300, 200)
    qapp.processEvents()
    assert [one.geometry().getRect() for one in (left, grows, right)] == [
        (0, 0, 100, 40), (110, 0, 150, 40), (200, 50, 100, 40),
    ]  # fmt: skip
    assert row.minimumSize().width() == 100
    window.close()
    window.deleteLater()
