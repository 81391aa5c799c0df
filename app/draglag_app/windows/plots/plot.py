"""The plot of all pages."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtGui import QBrush, QColor
from PySide6.QtWidgets import QWidget

from draglag_app.windows.parts.theme import theme
from draglag_app.windows.plots.plot_frame import PlotFrame
from draglag_app.windows.plots.plot_frame import tr as tr
from draglag_app.windows.plots.plot_values import Column, Series, near

# Of 255: a band is seen on both themes, and lines and grid through it.
_SHADE = 80
_BROAD_PX = 10


class Plot(PlotFrame):
    """A plot of named items: drawing again replaces, and "Save numbers" exports them."""

    def __init__(self, title: str, x: str, y: str, file_name: str = "plot", parent: QWidget | None = None) -> None:
        self._hover: dict[str, Series] = {}
        self._looks: dict[str, tuple[object, ...]] = {}
        super().__init__(title, x, y, file_name, parent)
        self.scene().sigMouseMoved.connect(self._hovered)

    # --- drawing --------------------------------------------------------------------------------------------

    def clear_all(self) -> None:
        """Remove everything."""
        for name in list(self._items):
            self.remove(name)

    def remove(self, name: str) -> None:
        for item in self._items.pop(name, []):
            self.removeItem(item)
        if not self._items:
            self._show_emptiness()
        self._numbers.pop(name, None)
        self._looks.pop(name, None)
        self._hover.pop(name, None)

    def line(
        self, name: str, x: Column, y: Column, colour: str, width: float = 2, dash: bool = False, legend: bool = True
    ) -> None:
        """Draw a line; NaN breaks it."""
        style = Qt.PenStyle.DashLine if dash else Qt.PenStyle.SolidLine
        look = (colour, width, dash)
        held = self._items.get(name)
        if held and isinstance(held[0], pg.PlotDataItem):
            held[0].setData(x, y, connect="finite")
            if self._looks.get(name) != look:  # a pen of its own costs as much again as the data
                held[0].setPen(pg.mkPen(colour, width=width, style=style))
        else:
            named = escape(name) if legend and self.legend is not None else None  # a legend takes HTML
            pen = pg.mkPen(colour, width=width, style=style)
            self._keep(name, self.plot(x, y, pen=pen, name=named, connect="finite"))
        self._looks[name] = look
        self._numbers[name] = (np.asarray(x), np.asarray(y))
        self._hover[name] = Series(np.asarray(x), np.asarray(y), joined=True)

    def dots(
        self,
        name: str,
        x: Column,
        y: Column,
        colour: str,
        symbol: str = "o",
        size: float = 9,
        hollow: bool = False,
        error: Column | None = None,
        words: Sequence[str] = (),
        clicked: Callable[[int], None] | None = None,
        legend: bool = True,
    ) -> None:
        """Draw points; ``error``: bars' half length; ``words``: tips."""
        x, y = np.asarray(x, float), np.asarray(y, float)
        look = (colour, symbol, size, hollow)
        if error is None and not words and clicked is None and self._looks.get(name) == look:
            self._items[name][0].setData(x=x, y=y)  # more of the same
            self._numbers[name] = (x, y)
            self._hover[name] = Series(x, y)
            return
        self.remove(name)
        if error is None and not words and clicked is None:
            self._looks[name] = look
        if error is not None and len(x):
            bars = pg.ErrorBarItem(x=x, y=y, height=2 * np.asarray(error), beam=0, pen=pg.mkPen(colour, width=1.5))
            self.addItem(bars)
            self._keep(name, bars)
        brush = pg.mkBrush(None) if hollow else pg.mkBrush(colour)
        named = escape(name) if legend and self.legend is not None else None  # a legend takes HTML
        item = pg.ScatterPlotItem(
            x=x, y=y, symbol=symbol, size=size, brush=brush, pen=pg.mkPen(colour, width=1.6), name=named
        )
        if clicked is not None:
            item.sigClicked.connect(lambda scatter, points, event: clicked(int(points[0].index())))
        self.addItem(item)
        self._keep(name, item)
        self._numbers[name] = (x, y) if error is None else (x, y, np.asarray(error))
        self._hover[name] = Series(x, y, words=words)

    def band(self, name: str, x: Column, low: Column, high: Column, colour: str, legend: str = "") -> None:
        """Shade between two curves; ``legend``: name there."""
        self.remove(name)
        shade = QColor(colour)
        shade.setAlpha(_SHADE)
        # Not items of data: without a pen those have no path, and nothing would be filled between them.
        edges = [pg.PlotCurveItem(np.asarray(x), np.asarray(y), pen=pg.mkPen(None)) for y in (low, high)]
        fill = pg.FillBetweenItem(*edges, brush=pg.mkBrush(shade))
        fill.setZValue(-10)
        # A legend knows lines and points: a broad line of the same colour, without a point of its own.
        named = [pg.PlotDataItem([], [], pen=pg.mkPen(shade, width=_BROAD_PX), name=escape(legend))] if legend else []
        for item in (*edges, fill, *named):
            self.addItem(item)
            self._keep(name, item)
        self._numbers[name] = (np.asarray(x), np.asarray(low), np.asarray(high))

    def bars(
        self,
        name: str,
        centre: Column,
        height: Column,
        width: float,
        colour: str,
        base: Column | float = 0.0,
        hatched: bool = False,
        words: Sequence[str] = (),
    ) -> None:
        """Draw bars from ``base`` up; ``hatched``: provisional."""
        self.remove(name)
        x, up = np.asarray(centre, float), np.asarray(height, float)
        low = np.broadcast_to(np.asarray(base, float), up.shape)
        shade = QColor(colour)
        shade.setAlpha(150)
        brush = QBrush(shade, Qt.BrushStyle.BDiagPattern if hatched else Qt.BrushStyle.SolidPattern)
        style = Qt.PenStyle.DashLine if hatched else Qt.PenStyle.SolidLine
        item = pg.BarGraphItem(x=x, y0=low, height=up, width=width, brush=brush, pen=pg.mkPen(colour, style=style))
        self.addItem(item)
        self._keep(name, item)
        self._numbers[name] = (x, up) if np.isscalar(base) else (x, low, low + up)
        self._hover[name] = Series(x, low + up, words=words)

    def upright(self, name: str, at: float, colour: str, text: str = "") -> None:
        """Draw a vertical mark."""
        self.remove(name)
        item = pg.InfiniteLine(
            at, pen=pg.mkPen(colour, width=1.6, style=Qt.PenStyle.DashLine), label=text or None,
            labelOpts={"position": 0.92, "color": theme().text, "fill": pg.mkBrush(theme().panel)},
        )  # fmt: skip
        self.addItem(item)
        self._keep(name, item)
        self._numbers[name] = (np.array([at]),)

    def leave_room_above(self, share: float) -> None:
        """Make room for a legend, as a share of the height."""
        heights = [np.asarray(column, float) for columns in self._numbers.values() for column in columns[1:]]
        values = np.concatenate(heights) if heights else np.empty(0)
        values = values[np.isfinite(values)]
        if values.size:
            low, high = float(values.min()), float(values.max())
            span = max(high - low, 1e-3)
            self.setYRange(low - 0.05 * span, high + share * span, padding=0)

    def _keep(self, name: str, item: Any) -> None:
        first = not self._items
        self._items.setdefault(name, []).append(item)
        if first or self.legend is not None:
            self._show_emptiness()

    # --- hover ----------------------------------------------------------------------------------------------

    def _hovered(self, at: Any) -> None:
        found = near(self.getPlotItem().vb, at, self._hover, self._labels[1:])
        if found is None:
            self._tip.hide()
            return
        (x0, x1), (y0, y1) = self.getPlotItem().vb.viewRange()
        upper = (found.y > (y0 + y1) / 2) != self.getPlotItem().vb.yInverted()
        self._tip.setAnchor((1 if found.x > (x0 + x1) / 2 else 0, 0 if upper else 1))
        self._tip.setText(found.words)
        self._tip.setPos(found.x, found.y)
        self._tip.show()

    @property
    def drawn(self) -> Mapping[str, tuple[Column, ...]]:
        """Name → columns."""
        return self._numbers
