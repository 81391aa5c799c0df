"""On a screen of 1280 x 800, at 100 and at 150 %, below a window's title bar: nothing is cut off or overlaps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pyqtgraph as pg
import pytest
from PySide6.QtCore import QPoint, QPointF, QRect
from PySide6.QtWidgets import QApplication, QLabel, QPushButton, QTableWidgetItem, QWidget

from draglag_app.windows.main import _AROUND_PX
from draglag_app.windows.parts.page_stack import PageScroll
from draglag_app.windows.plots.plot_frame import PlotFrame
from draglag_app.windows.window import OperatorWindow
from draglag_app.windows.wording.i18n import use_language

# What the screen has at each scaling, less a title bar.
WHOLE, ENLARGED = (1280, 800 - _AROUND_PX[1]), (853, 533 - _AROUND_PX[1])


def at_size(window: OperatorWindow, size: tuple[int, int], page: str) -> None:
    window.resize(*size)
    window.go(page)
    for _ in range(10):
        QApplication.processEvents()
    assert (window.width(), window.height()) == size


def titles_outside(plot: PlotFrame) -> list[str]:
    """Titles of axes that reach beyond the plot."""
    whole = plot.getPlotItem().sceneBoundingRect().adjusted(-1, -1, 1, 1)
    axes = [plot.getPlotItem().getAxis(side) for side in ("bottom", "left")]
    places = {axis.labelText: axis.label.sceneBoundingRect().adjusted(8, 8, -8, -8) for axis in axes}
    return [title for title, place in places.items() if not whole.contains(place)]


def on_top(page: QWidget) -> list[tuple[str, str]]:
    """Plots, words and buttons of one parent that share some place."""
    kinds = (PlotFrame, QLabel, QPushButton)
    seen = [one for one in page.findChildren(QWidget) if isinstance(one, kinds) and one.isVisibleTo(page)]
    found = []
    for k, one in enumerate(seen):
        for other in seen[k + 1 :]:
            if one.parent() is other.parent() and one.geometry().intersects(other.geometry()):
                found.append((str(one), str(other)))
    return found


@pytest.mark.parametrize("size", [WHOLE, ENLARGED])
def test_titles_of_axes_are_whole_and_nothing_lies_on_top_of_another(
    opened: OperatorWindow, until: Callable, size: tuple[int, int]
) -> None:
    opened.ask("calibrate")
    until(lambda: not opened.space.calibrating.active)
    for name, (_, page) in opened.pages.items():
        at_size(opened, size, name)
        for plot in page.findChildren(PlotFrame):
            if plot.isVisible():
                assert titles_outside(plot) == [], (name, plot.file_name)
        assert on_top(page) == [], name


@pytest.mark.parametrize("size", [WHOLE, ENLARGED])
def test_pages_are_scrolled_up_and_down_alone(opened: OperatorWindow, size: tuple[int, int]) -> None:
    (scroll,) = opened.findChildren(PageScroll)
    for name in opened.pages:
        at_size(opened, size, name)
        assert scroll.horizontalScrollBar().maximum() == 0, name


@pytest.mark.parametrize("recording", [False, True])
def test_record_fits_below_a_title_bar_without_scrolling(open_window: Callable, recording: bool) -> None:
    window = open_window()
    window.record.set_recording(recording)
    at_size(window, WHOLE, "record")
    (scroll,) = window.findChildren(PageScroll)
    assert scroll.verticalScrollBar().maximum() == 0
    button = window.record.buttons["stop" if recording else "start"]
    place = QRect(button.mapTo(window, QPoint(0, 0)), button.size())
    assert button.isVisible()
    assert window.rect().contains(place)
    window.record.set_recording(False)


def test_names_of_compared_sessions_keep_their_room(opened: OperatorWindow) -> None:
    opened.go("compare")
    named = {button.text(): button for button in opened.pages["compare"][1].findChildren(QPushButton)}
    named["Add open session"].click()
    at_size(opened, ENLARGED, "compare")
    table = opened.pages["compare"][1].table
    first = table.item(0, 0).text()[:6]
    assert table.columnWidth(0) >= table.fontMetrics().horizontalAdvance(first)


@pytest.mark.parametrize("flat", [False, True])
@pytest.mark.parametrize("language", ["en", "nl"])
def test_names_of_alternative_curves_cover_no_run(
    open_window: Callable, qapp: QApplication, until: Callable, show_session: Callable, language: str, flat: bool
) -> None:
    try:
        window = open_window(language=language)
        show_session(window)
        at_size(window, (1280, 800), "results")
        results = window.pages["results"][1]
        results.show_alternatives.click()
        until(lambda: not window.space.tasks.running and len(results.curve.legend.items) > 4)
        if flat:  # of a curve that hardly falls fast runs lie highest
            analysis = window.space.analysis
            level = [replace(run, latency_s=0.09) for run in analysis.runs]
            results.curve.draw(level, analysis.curve, alternatives=results._alternatives)
        qapp.processEvents()
        item = results.curve.getPlotItem()
        legend = results.curve.legend
        covered = legend.mapRectToScene(legend.boundingRect()).adjusted(-6, -6, 6, 6)  # with half a point
        runs = [one for one in item.items if isinstance(one, pg.ScatterPlotItem)]
        places = [item.vb.mapViewToScene(QPointF(x, y)) for one in runs for x, y in zip(*one.getData(), strict=True)]
        assert len(places) >= 6
        assert [place for place in places if covered.contains(place)] == []
        whole = item.vb.sceneBoundingRect()
        highest = min(place.y() for place in places)
        assert whole.bottom() - highest > whole.height() / 3  # names one below the other leave a quarter
    finally:
        use_language(qapp, "en")


@pytest.mark.parametrize("size", [ENLARGED, (960, 540 - _AROUND_PX[1]), WHOLE])
def test_latency_and_verdict_of_a_run_are_in_sight_while_it_is_recorded(
    open_window: Callable, size: tuple[int, int]
) -> None:
    window = open_window()
    table = window.record.table
    table.insertRow(0)
    for column, text in enumerate(("run-12", "multi-sine", "1000", "134.3 ± 11.7 ms", "1248", "✓ good")):
        table.setItem(0, column, QTableWidgetItem(text))
    at_size(window, size, "record")
    for column in (0, 3, 5):
        assert table.columnWidth(column) >= table.sizeHintForColumn(column)
        assert table.columnViewportPosition(column) + table.sizeHintForColumn(column) <= table.viewport().width()
