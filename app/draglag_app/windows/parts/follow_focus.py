"""Scroll areas that follow the keyboard's focus."""

from __future__ import annotations

import shiboken6
from PySide6.QtCore import QObject
from PySide6.QtWidgets import QApplication, QScrollArea, QWidget


class FollowFocus(QObject):
    """Scrolls to the focused widget; Qt does so only for Tab."""

    def __init__(self, area: QScrollArea) -> None:
        super().__init__(area)
        self._area = area
        application = QApplication.instance()
        if isinstance(application, QApplication):
            application.focusChanged.connect(self._follow)

    def _follow(self, before: QWidget | None, now: QWidget | None) -> None:
        if not shiboken6.isValid(self._area):  # the focus also leaves a window that is being deleted
            return
        inside = self._area.widget()
        if now is None or inside is None or not inside.isAncestorOf(now):
            return
        # A page that has the focus as a whole stays at its top: no scrolling would show all of it.
        if now.height() <= self._area.viewport().height():
            self._area.ensureWidgetVisible(now)
