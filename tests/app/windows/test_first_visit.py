"""A page is made at its first visit, and is then what it would be had it been there from the beginning."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractScrollArea,
    QAbstractSpinBox,
    QApplication,
    QComboBox,
    QLabel,
    QLineEdit,
    QListWidget,
    QScroller,
    QTableWidget,
    QTextEdit,
    QWidget,
)

from app.windows.conftest import settle, short_protocol
from draglag.protocol.runs import load_protocol
from draglag_app.session.machine import Phase
from draglag_app.windows.pages.parts import precision_preview
from draglag_app.windows.pages.preferences import PreferencesPage
from draglag_app.windows.parts.theme import apply_theme, theme
from draglag_app.windows.plots.plot import Plot
from draglag_app.windows.settings import CalibrationSettings
from draglag_app.windows.window import OperatorWindow
from draglag_app.windows.wording.i18n import use_language

LATE = ("geometry", "protocol", "results", "gap", "compare", "preferences", "help")
Change = Callable[[OperatorWindow], None]
_SIZE = (1400, 900)


def words_of(widget: QWidget) -> object:
    """What stands in it."""
    if isinstance(widget, QLabel | QAbstractButton):
        return widget.text(), isinstance(widget, QAbstractButton) and widget.isChecked()
    if isinstance(widget, QComboBox):
        return widget.currentText(), [widget.itemText(k) for k in range(widget.count())]
    if isinstance(widget, QLineEdit | QAbstractSpinBox):
        return widget.text()
    if isinstance(widget, QTextEdit):
        return widget.toPlainText()
    if isinstance(widget, QListWidget):
        return [widget.item(k).text() for k in range(widget.count())]
    if isinstance(widget, QTableWidget):
        cells = [widget.item(row, k) for row in range(widget.rowCount()) for k in range(widget.columnCount())]
        chosen = [index.row() for index in widget.selectionModel().selectedRows()]
        return chosen, [
            (cell.text(), cell.toolTip(), cell.foreground().color().name()) for cell in cells if cell is not None
        ]
    if isinstance(widget, Plot):
        axes = [widget.getPlotItem().getAxis(side).labelText for side in ("bottom", "left")]
        return axes, widget.csv(), widget.backgroundBrush().color().name(), widget._looks
    return None


def manner_of(widget: QWidget) -> object:
    """How it takes fingers, drops, and keys that are the window's."""
    if isinstance(widget, QAbstractScrollArea):
        return QScroller.hasScroller(widget.viewport())
    if isinstance(widget, QComboBox):
        return type(widget.itemDelegate()).__name__
    if isinstance(widget, QLineEdit):
        undo = QKeyEvent(QEvent.Type.ShortcutOverride, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
        undo.ignore()
        QApplication.sendEvent(widget, undo)
        return widget.acceptDrops(), undo.isAccepted()
    return None


@dataclass(frozen=True)
class Seen:
    """A page that the window shows."""

    facts: Counter[str]
    ranges: np.ndarray
    tab_order: list[str]


def facts_of(page: QWidget) -> Iterator[str]:
    """All that can be read of everything on the page; Qt itself changes the order of a table's parts."""
    for widget in (page, *page.findChildren(QWidget)):
        shown = widget.isVisibleTo(page)
        yield repr(
            (
                type(widget).__name__, widget.accessibleName(), words_of(widget), manner_of(widget), widget.toolTip(),
                shown, shown and widget.geometry().getRect(), widget.isEnabled(), widget.property("level"),
                widget.font().pointSizeF(),
            )
        )  # fmt: skip


def tab_order(page: QWidget) -> list[QWidget]:
    """Everything in the window that Tab reaches, from the page on."""
    reached, widget = [], page.nextInFocusChain()
    while widget is not page:
        if widget.isVisible() and widget.isEnabled() and widget.focusPolicy() & Qt.FocusPolicy.TabFocus:
            reached.append(widget)
        widget = widget.nextInFocusChain()
    return reached


def visit(window: OperatorWindow, qapp: QApplication, name: str) -> Seen:
    window.go(name)
    window.notify("warning", "Something to tab to.")
    settle(qapp)
    page = window.pages[name][1]
    assert window.stack.currentWidget() is page
    ranges = [plot.getPlotItem().vb.viewRange() for plot in page.findChildren(Plot) if plot.isVisible()]
    order = [f"{type(one).__name__} {one.accessibleName()} {one.toolTip()}" for one in tab_order(page)]
    return Seen(Counter(facts_of(page)), np.array(ranges).reshape(-1, 2), order)


def nothing(window: OperatorWindow) -> None:
    """No change."""


def compare(
    change: Change,
    make: Callable[[], OperatorWindow],
    qapp: QApplication,
    names: Sequence[str] = LATE,
    after: Change = nothing,
) -> None:
    """Bring about the same in two windows, in one of which every page was visited before."""
    known: list[dict[str, Seen]] = []
    for early in (True, False):
        window = make()
        window.resize(*_SIZE)
        settle(qapp)
        if early:
            window.pages.make_all()
            for name in (*names, "record"):
                window.go(name)
                settle(qapp)
        change(window)
        assert early or set(LATE).isdisjoint(window.pages.made)
        known.append({name: visit(window, qapp, name) for name in names})
        after(window)
        window.hide()
    for name in names:
        before, now = (pages[name] for pages in known)
        assert (now.facts - before.facts, before.facts - now.facts) == (Counter(), Counter()), name
        assert now.tab_order == before.tab_order, name
        # What is drawn while a page is hidden is fitted into the size that the plot has then.
        assert (np.abs(now.ranges - before.ranges) <= 0.02 * np.ptp(before.ranges, axis=1, keepdims=True)).all(), name


@pytest.fixture(autouse=True)
def looks_as_before(qapp: QApplication, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(precision_preview, "_PAUSE_MS", 600_000)  # no prediction comes between two looks
    yield
    use_language(qapp, "en")
    apply_theme(qapp, "dark", 1.0)


@pytest.fixture
def analysed(show_session: Callable) -> Change:
    """Opens a session, analyses it and comments on a run."""

    def open_it(window: OperatorWindow) -> None:
        show_session(window)
        window.space.comment(window.space.session.runs[1].id, "slipped")

    return open_it


def changed(window: OperatorWindow) -> None:
    """Other settings, protocol and geometry, each of them undoable or kept; one change is undone."""
    space = window.space
    space.change_settings(keys={"calibrate": "Ctrl+Shift+K", "cancel": "Ctrl+Shift+P"}, operator="Ada", sound=True)
    space.change_settings(language="nl", text_scale=1.5, begin_by_hand=True, reopen=True)  # both after a restart
    panel = space.settings.panel
    across, down = (0.0, 500.0, 1000.0) * 3, (0.0,) * 3 + (500.0,) * 3 + (1000.0,) * 3
    made = CalibrationSettings(address="sim:", device="a panel", made_utc="2026", x_raw=across, y_raw=down)
    space.change_settings(panel=panel.model_copy(update={"width_mm": 321.0, "calibration": made}))
    space.change_protocol(load_protocol("demo"), "load")
    space.change_protocol(short_protocol().model_copy(update={"name": "other", "shuffle": True}), "edit")
    space.undo.undo()
    window.ask("theme")


def test_only_the_pages_that_would_miss_something_are_made_at_once(open_window: Callable) -> None:
    assert set(open_window().pages.made) == {"bench", "record", "log"}


def test_with_nothing_at_hand(open_window: Callable, qapp: QApplication) -> None:
    compare(nothing, open_window, qapp)


def test_the_first_pages_are_the_same_without_the_others(open_window: Callable, qapp: QApplication) -> None:
    compare(lambda window: window.resize(window.minimumSizeHint()), open_window, qapp, ("record", "bench"))


def test_with_a_session_analysed(open_window: Callable, qapp: QApplication, analysed: Change) -> None:
    compare(analysed, open_window, qapp)


def test_with_everything_changed(open_window: Callable, qapp: QApplication, analysed: Change) -> None:
    def change(window: OperatorWindow) -> None:
        analysed(window)
        changed(window)

    compare(change, open_window, qapp)


def test_in_dutch_with_large_text_and_keys_chosen_before(
    open_window: Callable, qapp: QApplication, analysed: Change
) -> None:
    settings = {"language": "nl", "text_scale": 1.5, "theme": "light", "keys": {"calibrate": "Ctrl+Shift+K"}}
    compare(analysed, lambda: open_window(**settings), qapp)


@pytest.mark.usefixtures("short_countdown")
def test_while_recording(open_window: Callable, qapp: QApplication, until: Callable) -> None:
    def make() -> OperatorWindow:
        return open_window(rig={"touch": "sim:", "laser": "sim:", "display": "offscreen"})

    def record(window: OperatorWindow) -> None:
        runs = [short_protocol().runs[1].model_copy(update={"duration_s": 60.0})]
        window.space.set_protocol(short_protocol().model_copy(update={"runs": tuple(runs), "taps": None}))
        window.ask("start")
        until(lambda: window.record._phase is Phase.RECORDING)

    def stop(window: OperatorWindow) -> None:
        window.ask("stop")
        until(lambda: not window.space.recording.active and not window.space.tasks.running)

    compare(record, make, qapp, after=stop)


def test_no_page_is_left_to_make_while_a_participant_follows_a_target(open_window: Callable, until: Callable) -> None:
    window = open_window(rig={"touch": "sim:", "laser": "sim:", "display": "window"})
    window.space.set_protocol(short_protocol().model_copy(update={"taps": None}))
    window.ask("start")
    assert set(window.pages.made) == set(window.pages)
    window.ask("stop")
    until(lambda: not window.space.recording.active and not window.space.tasks.running)


def test_tab_goes_from_a_page_to_the_notice_then_from_top_to_bottom(open_window: Callable, qapp: QApplication) -> None:
    window = open_window()
    window.notify("warning", "Something to tab to.")
    for name in LATE:
        window.go(name)
        settle(qapp)
        page = window.stack.currentWidget()
        around = [one for one in tab_order(page) if not page.isAncestorOf(one)]
        steps = [one for one in window.steps.buttons.values() if one.isVisible()]
        assert around == [window.notice.dismiss, window.header.help, *steps, *window.navigation.tabs.values()], name
    shown = [one for one in window.centralWidget().children() if isinstance(one, QWidget) and one.isVisible()]
    assert [shown[0], shown[-1]] == [window.header, window.notice]  # so they are read to who does not see them


def test_help_speaks_the_language_of_the_window_until_it_is_opened_again(
    open_window: Callable, qapp: QApplication
) -> None:
    window = open_window()
    window.space.change_settings(language="nl")
    window.ask("help_here")
    page = window.pages["help"][1]
    for theme_changed in (False, True):
        if theme_changed:
            window.ask("theme")
        assert "laser beam" in page.manual.toPlainText()
        assert window.pages.titles["record"] in [page.contents.item(k).text() for k in range(page.contents.count())]


def test_the_theme_chosen_at_the_first_visit_is_used(open_window: Callable, qapp: QApplication) -> None:
    window = open_window()
    window.go("preferences")
    page = window.stack.currentWidget()
    assert isinstance(page, PreferencesPage)
    page.theme.setCurrentIndex(page.theme.findData("light"))
    page.theme.activated.emit(page.theme.currentIndex())
    assert theme().name == "light"


def test_keys_changed_after_a_visit_are_shown_there(open_window: Callable, qapp: QApplication) -> None:
    window = open_window()
    window.go("geometry")
    window.go("help")
    window.space.change_settings(keys={"calibrate": "Ctrl+Shift+K"})
    assert window.geometry_page.calibration.begin.text().endswith("Ctrl+Shift+K")
    assert "Ctrl+Shift+K" in window.pages["help"][1].keys.toPlainText()
