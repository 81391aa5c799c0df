"""Columns that are stacked in a narrow window."""

from __future__ import annotations

from PySide6.QtCore import QRect, QSize, Qt
from PySide6.QtWidgets import QLayoutItem, QWidget

from draglag_app.windows.parts.item_list import ItemList
from draglag_app.windows.parts.widgets import Scrolled


class Columns(ItemList):
    """Widgets with shares of the width; stacked, each as high as needed."""

    def __init__(self, spacing_px: int = 10) -> None:
        super().__init__(spacing_px)
        self._shares: list[int] = []

    def add_column(self, widget: QWidget, share: int) -> None:
        """Add a column; share 0: as narrow as possible."""
        self._shares.append(share)
        self.addWidget(widget)

    def stacked(self, width: int) -> bool:
        """Whether columns are stacked at that width."""
        return width < sum(item.minimumSize().width() for item in self._items) + self._between()

    # --- what a layout must know ----------------------------------------------------------------------------

    def expandingDirections(self) -> Qt.Orientation:
        return Qt.Orientation.Horizontal | Qt.Orientation.Vertical

    def heightForWidth(self, width: int) -> int:
        if self.stacked(width):
            return sum(_whole(item, width) for item in self._items) + self._between()
        return max(map(_least, self._items, self._widths(width)), default=0)

    def minimumHeightForWidth(self, width: int) -> int:
        return self.heightForWidth(width)

    def sizeHint(self) -> QSize:
        hints = [item.sizeHint() for item in self._items]
        return QSize(sum(h.width() for h in hints) + self._between(), max((h.height() for h in hints), default=0))

    def minimumSize(self) -> QSize:
        least = [item.minimumSize() for item in self._items]
        return QSize(max((s.width() for s in least), default=0), max((s.height() for s in least), default=0))

    def setGeometry(self, rect: QRect) -> None:
        super().setGeometry(rect)
        if self.stacked(rect.width()):
            top = rect.top()
            for item in self._items:
                height = _whole(item, rect.width())
                item.setGeometry(QRect(rect.left(), top, rect.width(), height))
                top += height + self.spacing()
            return
        left = rect.left()
        for item, width in zip(self._items, self._widths(rect.width()), strict=True):
            item.setGeometry(QRect(left, rect.top(), width, rect.height()))
            left += width + self.spacing()

    # --- sizes ----------------------------------------------------------------------------------------------

    def _between(self) -> int:
        return self.spacing() * max(0, len(self._items) - 1)

    def _widths(self, width: int) -> list[int]:
        room, left = width - self._between(), list(range(len(self._items)))
        found = [item.minimumSize().width() for item in self._items]
        while left:
            shares = max(1, sum(self._shares[k] for k in left))
            tight = [k for k in left if room * self._shares[k] / shares < found[k]]
            for k in tight or left:
                found[k] = found[k] if tight else int(room * self._shares[k] / shares)
            room -= sum(found[k] for k in tight)
            left = [k for k in left if k not in tight] if tight else []
        return found


def _least(item: QLayoutItem, width: int) -> int:
    widget = item.widget()
    layout = None if widget is None or isinstance(widget, Scrolled) else widget.layout()
    if layout is not None and layout.hasHeightForWidth():
        return layout.totalMinimumHeightForWidth(width)
    return item.minimumSize().height()


def _whole(item: QLayoutItem, width: int) -> int:
    widget = item.widget()
    return widget.whole_height(width) if isinstance(widget, Scrolled) else _least(item, width)
