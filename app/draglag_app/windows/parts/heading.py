"""A heading with buttons."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QSize
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QGridLayout, QWidget


class Heading(QWidget):
    """``buttons`` right of ``title``, ``below`` under both; swapped where the title would have less than
    ``title_px``."""

    def __init__(self, title: QWidget, buttons: QWidget, below: QWidget, title_px: int) -> None:
        super().__init__()
        self._buttons, self._below = buttons, below
        self._title_px = title_px
        self.buttons_below = False
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setVerticalSpacing(4)
        self._grid.setColumnStretch(0, 1)
        self._grid.addWidget(title, 0, 0)
        self._arrange()

    def minimumSizeHint(self) -> QSize:
        least = max(self._buttons.minimumSizeHint().width(), self._title_px + self._below.minimumSizeHint().width())
        return QSize(least, super().minimumSizeHint().height())

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._choose()

    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.LayoutRequest:  # other buttons than before are in sight
            self._choose()
        return super().event(event)

    def _choose(self) -> None:
        narrow = self._title_px + self._buttons.minimumSizeHint().width() > self.width()
        if narrow != self.buttons_below:
            self.buttons_below = narrow
            self._arrange()

    def _arrange(self) -> None:
        right, under = (self._below, self._buttons) if self.buttons_below else (self._buttons, self._below)
        self._grid.addWidget(right, 0, 1)
        self._grid.addWidget(under, 1, 0, 1, 2)
        self._grid.setColumnStretch(1, 1 if self.buttons_below else 0)
