"""An axis whose title fits the plot."""

from __future__ import annotations

import math
import re
from typing import Any

import pyqtgraph as pg
from PySide6.QtCore import QPointF
from PySide6.QtGui import QColor, QFontMetricsF, QGuiApplication, QPainter, QPen
from PySide6.QtWidgets import QGraphicsSceneResizeEvent

from draglag_app.windows.parts.theme import points, theme

# Letters of a title: the usual size first, then smaller ones for plots with little room.
_LETTERS_PT = (10, 9, 8)
# Between the end of a title and the plot's edge.
_EDGE_PX = 2
# Behind the view (pyqtgraph gives it -100): its grid would lie over what is drawn there.
BEHIND_VIEW = -101


class Axis(pg.AxisItem):
    """An axis with a fitting title; pyqtgraph would cut a long one off."""

    def write(self, title: str, room_px: float) -> None:
        """Write the title as large as fits, else its unit."""
        unit = re.search(r"\(([^()]+)\)$", title)
        attempts = [(title, size) for size in _LETTERS_PT]
        if unit:
            attempts.append((unit[1], _LETTERS_PT[-1]))
        for text, size in attempts:
            # Without ranges for prefixes: numbers below one would be shown a thousandfold, under an unchanged title.
            style = {"color": theme().text, "font-size": points(size)}
            self.setLabel(text, siPrefixEnableRanges=(), **style)
            if self.label.boundingRect().width() + 2 * _EDGE_PX <= room_px:
                break
        self._keep_inside()

    def resizeEvent(self, event: QGraphicsSceneResizeEvent | None = None) -> None:
        super().resizeEvent(event)
        self._keep_inside()

    def tickSpacing(self, minVal: float, maxVal: float, size: float) -> list[tuple[float, float]]:
        """As pyqtgraph's, but numbers of a low plot do not stand on each other."""
        levels: list[tuple[float, float]] = super().tickSpacing(minVal, maxVal, size)
        if self.orientation != "left" or size <= 0 or self.logMode:
            return levels
        line_px = QFontMetricsF(self.style["tickFont"] or QGuiApplication.font()).height()
        least = line_px * abs(maxVal - minVal) / size
        if not levels or levels[0][0] >= least > 0:
            return levels
        unit = 10 ** math.floor(math.log10(least))
        spacing = next(step * unit for step in (1, 2, 5, 10) if step * unit >= least)
        return [(spacing, levels[0][1]), *levels[1:]]

    def drawPicture(self, p: QPainter, axisSpec: Any, tickSpecs: list[Any], textSpecs: list[Any]) -> None:
        """As pyqtgraph's, in the colour that half-transparent lines would have: those take ten times longer."""
        opaque = [(_on_panel(pen), begin, end) for pen, begin, end in tickSpecs]
        super().drawPicture(p, axisSpec, opaque, textSpecs)

    def _keep_inside(self) -> None:
        parent, label = self.parentItem(), self.label
        if parent is None or label is None:
            return
        whole, at = parent.boundingRect(), label.pos()
        long = label.boundingRect().width()
        low, high = self.mapFromItem(parent, whole.topLeft()), self.mapFromItem(parent, whole.bottomRight())
        if self.orientation == "left":  # turned: it begins below and ends above
            most = high.y() - _EDGE_PX
            label.setPos(QPointF(at.x(), max(min(at.y(), most), min(low.y() + _EDGE_PX + long, most))))
        else:
            least = low.x() + _EDGE_PX
            label.setPos(QPointF(min(max(at.x(), least), max(high.x() - _EDGE_PX - long, least)), at.y()))


def _on_panel(pen: QPen) -> QPen:
    """A pen without transparency: its colour as it looks on a plot's ground."""
    line, ground = pen.color(), QColor(theme().panel)
    share = line.alpha() / 255
    pairs = zip((line.red(), line.green(), line.blue()), (ground.red(), ground.green(), ground.blue()), strict=True)
    opaque = QPen(pen)
    opaque.setColor(QColor(*(round(share * a + (1 - share) * b) for a, b in pairs)))
    return opaque
