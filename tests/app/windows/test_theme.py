"""A theme is put on whole, and once."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QEvent, QObject
from PySide6.QtGui import QColor, QImage, QPalette
from PySide6.QtWidgets import QApplication

from app.windows.conftest import settle
from draglag_app.windows.parts.theme import theme

PAGES = ("preferences", "geometry", "results", "gap")


class Restyled(QObject):
    """How often its widget was given a style."""

    count = 0

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        self.count += event.type() == QEvent.Type.StyleChange
        return False


def test_the_other_theme_and_back_leave_every_page_as_it_was(open_window: Callable, qapp: QApplication) -> None:
    window = open_window()
    window.resize(1400, 900)
    looks: dict[str, list[QImage]] = {name: [] for name in PAGES}
    for chosen in ("light", "dark", "light", "dark", "light"):
        window.use_theme(chosen)
        # What no style sheet colours has the palette's colours: lists, dialogs, tooltips.
        assert qapp.palette().color(QPalette.ColorRole.Window) == QColor(theme().window)
        for name, seen in looks.items():
            window.go(name)
            settle(qapp)
            seen.append(window.pages[name][1].grab().toImage())
    for name, (_, dark, light, again_dark, again_light) in looks.items():  # of a first visit, some is drawn afterwards
        assert (dark == again_dark, light == again_light, dark == light) == (True, True, False), name
    window.use_theme("dark")  # as other tests have it


def test_a_theme_that_is_on_is_left_alone(open_window: Callable, qapp: QApplication) -> None:
    window = open_window()
    restyled = Restyled()
    window.navigation.installEventFilter(restyled)
    window.use_theme(theme().name)
    assert restyled.count == 0
    window.use_theme("light" if theme().name == "dark" else "dark")
    assert restyled.count > 0
    window.use_theme("dark")  # as other tests have it
