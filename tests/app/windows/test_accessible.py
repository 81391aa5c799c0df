"""Every page through Qt's accessibility tree: what a screen reader reads, and the order the keyboard goes in."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise

from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QAccessible, QAccessibleInterface, QKeySequence
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QTabWidget, QWidget

from draglag_app.windows.actions import ACTIONS, keys_of
from draglag_app.windows.parts.page_stack import PageScroll
from draglag_app.windows.plots.plot import Plot
from draglag_app.windows.settings import load_settings
from draglag_app.windows.window import OperatorWindow

Role = QAccessible.Role
# Parts of a widget that has a name itself, or frames without words.
_PARTS = {Role.Cell, Role.ColumnHeader, Role.RowHeader, Role.ScrollBar, Role.ListItem, Role.PageTab, Role.Grip}
# Qt has no role for these; their names identify them.
_DRAWN = (Plot, QTabWidget)


def tree(node: QAccessibleInterface, path: str = "") -> Iterator[tuple[str, QAccessibleInterface]]:
    """Every node that can be seen, with the names on the way to it."""
    yield path, node
    for k in range(node.childCount()):
        child = node.child(k)
        if child is not None and child.isValid() and not child.state().invisible and child.role() not in _PARTS:
            yield from tree(child, f"{path}/{child.text(QAccessible.Text.Name) or child.role().name}")


def test_everything_the_keyboard_reaches_has_a_name_and_a_role(opened: OperatorWindow, qapp: QApplication) -> None:
    unnamed, seen = [], 0
    for name in opened.pages:
        opened.go(name)
        qapp.processEvents()
        for path, node in tree(QAccessible.queryAccessibleInterface(opened)):
            made = node.object()
            viewport = made is not None and isinstance(made.parent(), Plot)  # the plot has its focus and its name
            if viewport or not node.state().focusable or node.state().disabled:
                continue
            seen += 1
            if node.role() is Role.NoRole or (node.role() is Role.Client and not isinstance(node.object(), _DRAWN)):
                unnamed.append((name, path, "no role"))
            elif not node.text(QAccessible.Text.Name).strip():
                unnamed.append((name, path, node.role().name))
    assert seen > 100
    assert unnamed == []
    for role, light in opened.header.lights.items():  # what they show by colour and shape is said in words too
        assert light.state in QAccessible.queryAccessibleInterface(light).text(QAccessible.Text.Name), role


def test_the_keyboard_goes_round_every_page_from_top_to_bottom(opened: OperatorWindow, qapp: QApplication) -> None:
    opened.resize(1280, 800)
    opened.activateWindow()
    for name in opened.pages:
        opened.go(name)
        qapp.processEvents()
        page = opened.pages[name][1]
        visited: list[QWidget] = []
        for _ in range(120):
            QTest.keyClick(QApplication.focusWidget() or opened, Qt.Key.Key_Tab)
            now = QApplication.focusWidget()
            if now in visited:
                break
            visited.append(now)
        inside = [widget for widget in visited if page.isAncestorOf(widget)]
        assert inside, name
        tops = [widget.mapTo(page, QPoint(0, 0)).y() for widget in inside]
        # Columns stand next to each other: the order may jump back up once or twice, never zigzag.
        jumps = sum(later < earlier - 60 for earlier, later in pairwise(tops))
        assert jumps <= 4, (name, tops)


def test_small_screens_reach_everything(opened: OperatorWindow, qapp: QApplication) -> None:
    for size in ((960, 540), (853, 533)):
        opened.resize(*size)
        for name in opened.pages:
            opened.go(name)
            qapp.processEvents()
            assert (opened.width(), opened.height()) == size, name
            assert opened.navigation.tabs[name].accessibleName(), name
            page = opened.pages[name][1]
            for widget in page.findChildren(QWidget):
                if widget.isVisible() and widget.isEnabled() and widget.focusPolicy() & Qt.FocusPolicy.TabFocus:
                    widget.setFocus(Qt.FocusReason.TabFocusReason)
                    qapp.processEvents()
                    drawn = widget.viewport() if isinstance(widget, Plot) else widget
                    assert not drawn.visibleRegion().isEmpty(), (name, size, widget.accessibleName())


def test_a_page_comes_into_sight_at_its_top_and_whole_where_it_fits(opened: OperatorWindow, qapp: QApplication) -> None:
    (scrolled,) = opened.findChildren(PageScroll)
    for size, whole in (((1280, 800), True), ((960, 540), False)):
        opened.resize(*size)
        for name in opened.pages:
            opened.go(name)
            qapp.processEvents()
            bar = scrolled.verticalScrollBar()
            assert bar.value() == 0, (name, size)
            if whole and name != "preferences":  # a list of keys is longer than any screen
                assert bar.maximum() == 0, (name, size)


def test_keys_are_changed_listed_and_kept(open_window: Callable[..., OperatorWindow]) -> None:
    window = open_window()
    panel = window.pages["preferences"][1].keys
    ids = [spec.id for spec in ACTIONS]
    panel.table.selectRow(ids.index("start"))
    panel.use("F6")  # another action has it
    assert "F6" in window.notice_text.text()
    assert window.space.settings.keys == {}
    panel.use("Ctrl+Shift+R")
    assert window.actions_table.made["start"].shortcut() == QKeySequence("Ctrl+Shift+R")
    assert window.record.buttons["start"].text().endswith("Ctrl+Shift+R")
    assert "Ctrl+Shift+R" in window.pages["help"][1].keys.toPlainText()
    kept, problem = load_settings(window.space.settings_file)
    assert not problem
    assert keys_of("start", kept.keys) == "Ctrl+Shift+R"
    panel.reset.click()
    assert window.actions_table.made["start"].shortcut() == QKeySequence("F5")
    assert window.record.buttons["start"].text().endswith("F5")


def test_every_page_has_its_section_in_the_manual(
    open_window: Callable[..., OperatorWindow], qapp: QApplication
) -> None:
    window = open_window()
    manual = window.pages["help"][1]
    for name, (title, _) in window.pages.items():
        if name == "help":
            continue
        window.go(name)
        window.header.help.click()
        qapp.processEvents()
        assert window.page == "help"
        assert manual.manual.textCursor().block().text() == title
    assert manual.look_for("OMRON", again=False)
    assert not manual.look_for("no such word", again=False)
