"""Rows that wrap."""

from __future__ import annotations

from PySide6.QtCore import QRect, QSize, Qt
from PySide6.QtWidgets import QHBoxLayout, QLayoutItem, QWidget

from draglag_app.windows.parts.item_list import ItemList


class Flow(ItemList):
    """Widgets in as many lines as needed."""

    def __init__(self, spacing_px: int = 8) -> None:
        super().__init__(spacing_px)
        self._growing: list[QWidget] = []
        self._right_from: int | None = None

    def add_growing(self, widget: QWidget) -> None:
        """Add a widget that takes the room left in its line."""
        self._growing.append(widget)
        self.addWidget(widget)

    def add_together(self, *widgets: QWidget) -> None:
        """Add widgets that stay in one line."""
        group = QWidget()
        row = QHBoxLayout(group)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(self.spacing())
        for widget in widgets:
            row.addWidget(widget)
        self.addWidget(group)

    def add_rest(self) -> None:
        """Put later widgets at the right end."""
        self._right_from = len(self._items)

    # --- what a layout must know ----------------------------------------------------------------------------

    def expandingDirections(self) -> Qt.Orientation:
        return Qt.Orientation.Horizontal

    def heightForWidth(self, width: int) -> int:
        lines = self._lines(width)
        return sum(map(self._height, lines)) + self.spacing() * max(0, len(lines) - 1)

    def sizeHint(self) -> QSize:
        shown = self._shown()
        wide = sum(_least(item).width() for item in shown) + self.spacing() * max(0, len(shown) - 1)
        return QSize(wide, self._height(shown))

    def minimumSize(self) -> QSize:
        shown = self._shown()
        return QSize(max((_least(item).width() for item in shown), default=0), self._height(shown))

    def setGeometry(self, rect: QRect) -> None:
        super().setGeometry(rect)
        top = rect.top()
        for line in self._lines(rect.width()):
            self._place(line, QRect(rect.left(), top, rect.width(), self._height(line)))
            top += self._height(line) + self.spacing()

    # --- lines ----------------------------------------------------------------------------------------------

    def _shown(self) -> list[QLayoutItem]:
        return [item for item in self._items if not item.isEmpty()]

    def _height(self, line: list[QLayoutItem]) -> int:
        return max((_least(item).height() for item in line), default=0)

    def _lines(self, width: int) -> list[list[QLayoutItem]]:
        lines: list[list[QLayoutItem]] = []
        used = 0
        for item in self._shown():
            needed = _least(item).width()
            if lines and used + self.spacing() + needed <= width:
                lines[-1].append(item)
                used += self.spacing() + needed
            else:
                lines.append([item])
                used = needed
        return lines

    def _place(self, line: list[QLayoutItem], place: QRect) -> None:
        left = place.left()
        room = place.width() - sum(_least(item).width() for item in line) - self.spacing() * (len(line) - 1)
        at_right = self._items[self._right_from :] if self._right_from is not None else []
        for item in line:
            size, widget = _least(item), item.widget()
            wide = min(size.width(), place.width())
            if widget in self._growing:
                more = max(0, min(room, widget.maximumWidth() - wide))
                wide, room = wide + more, room - more
            if at_right and item in at_right:
                left, room = left + max(0, room), 0
            down = place.top() + (place.height() - size.height()) // 2
            item.setGeometry(QRect(left, down, wide, size.height()))
            left += wide + self.spacing()


def _least(item: QLayoutItem) -> QSize:
    return item.sizeHint().expandedTo(item.minimumSize())
