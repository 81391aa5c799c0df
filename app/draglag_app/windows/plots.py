"""One kind of plot for all pages: labelled, readable in both themes, with hover values, copy and export."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QCoreApplication, QPoint, Qt
from PySide6.QtGui import QColor, QFocusEvent, QGuiApplication, QKeyEvent, QResizeEvent
from PySide6.QtWidgets import QFileDialog, QFrame, QGraphicsItem, QLabel, QMenu, QMessageBox, QSizePolicy, QWidget

from draglag.errors import DataError
from draglag_app.windows.plot_values import Column, Series, as_csv, near, write_picture, write_text
from draglag_app.windows.theme import theme


def tr(text: str) -> str:
    return QCoreApplication.translate("Plot", text)


class Plot(pg.PlotWidget):
    """A plot with titled axes in units.

    What is drawn goes through ``line``, ``dots``, ``band`` … under a name, so that drawing again replaces it, and
    so that "Save numbers" knows it.
    """

    def __init__(self, title: str, x: str, y: str, file_name: str = "plot", parent: QWidget | None = None) -> None:
        super().__init__(parent, enableMenu=False)
        # Its menu is not shown, but holds the switches of the grid, and belongs to nobody.
        menu = self.getPlotItem().ctrlMenu
        menu.setParent(self, menu.windowFlags())
        self.file_name = file_name
        self.setAccessibleName(title or f"{y} / {x}")
        self._labels: tuple[str, str, str] = (title, x, y)
        self._items: dict[str, list[Any]] = {}
        self._numbers: dict[str, tuple[Column, ...]] = {}
        self._hover: dict[str, Series] = {}
        self._looks: dict[str, tuple[object, ...]] = {}
        self._clicked: dict[str, Callable[[int], None]] = {}
        # Plots take what room there is instead of asking for the much that a graphics view would like.
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Ignored)
        self.setMinimumSize(160, 110)
        self.hideButtons()
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        self.customContextMenuRequested.connect(self._menu)
        self._tip = pg.TextItem("", anchor=(0, 1))
        self._tip.setZValue(50)
        self.getPlotItem().vb.addItem(self._tip, ignoreBounds=True)
        self._tip.hide()
        self.scene().sigMouseMoved.connect(self._hovered)
        self.legend: Any = None
        self._nothing = QLabel(tr("nothing yet"), self)
        self._nothing.setObjectName("hint")
        self._nothing.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._nothing.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        # A border of its own would push the axes out of sight.
        self._ring = QFrame(self)
        self._ring.setObjectName("focusRing")
        self._ring.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self._ring.hide()
        self.restyle()
        self._show_emptiness()

    def focusInEvent(self, event: QFocusEvent) -> None:
        super().focusInEvent(event)
        self._ring.setVisible(event.reason() in (Qt.FocusReason.TabFocusReason, Qt.FocusReason.BacktabFocusReason))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Return opens the menu, as the menu key does where a keyboard has one."""
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            self._menu(self.rect().center())
            event.accept()
            return
        super().keyPressEvent(event)

    def focusOutEvent(self, event: QFocusEvent) -> None:
        super().focusOutEvent(event)
        self._ring.hide()

    def add_legend(self, offset: tuple[int, int] = (-10, 8), columns: int = 1) -> None:
        """Names of what is drawn, in a corner."""
        self.legend = self.addLegend(offset=offset, labelTextSize="9pt", colCount=columns)
        self.restyle()
        self._show_emptiness()

    def name_above(self, title: str, marks: Iterable[tuple[str, str, str]], apart: str = " &nbsp; ") -> None:
        """A title with the names of what is drawn, (sign, colour, words) each: for plots with no room for a legend."""
        words = " &nbsp; ".join(f"<span style='color:{colour}'>{sign}</span> {text}" for sign, colour, text in marks)
        self.setTitle(f"{title}{apart}{words}", color=theme().text, size="10pt")

    def keep_axes_drawn(self) -> None:
        """Draw axes and grid once, into a picture that is put back: for plots redrawn several times a second.

        They cost as much as all the rest of such a plot, and change only when its range does.
        """
        for side in ("bottom", "left"):
            self.getPlotItem().getAxis(side).setCacheMode(QGraphicsItem.CacheMode.DeviceCoordinateCache)

    def rename(self, title: str) -> None:
        """Another title above the plot."""
        self._labels = (title, *self._labels[1:])
        self.restyle()

    def relabel(self, title: str, x: str, y: str) -> None:
        """Another title and other axes."""
        self._labels = (title, x, y)
        self.restyle()

    def restyle(self) -> None:
        """Take the present theme's colours."""
        colours = theme()
        self.setBackground(colours.panel)
        title, x, y = self._labels
        plot = self.getPlotItem()
        if title:
            plot.setTitle(title, color=colours.text, size="10pt")
        for side, text in (("bottom", x), ("left", y)):
            axis = plot.getAxis(side)
            # Without ranges for prefixes: numbers below one would be shown a thousandfold, under an unchanged title.
            axis.setLabel(text, siPrefixEnableRanges=(), **{"color": colours.text, "font-size": "10pt"})
            axis.setPen(pg.mkPen(colours.muted))
            axis.setTextPen(pg.mkPen(colours.text))
            axis.enableAutoSIPrefix(False)
        plot.showGrid(x=True, y=True, alpha=0.12)
        self._tip.setColor(QColor(colours.text))
        self._tip.fill = pg.mkBrush(colours.raised)
        self._tip.border = pg.mkPen(colours.line)
        if self.legend is not None:
            self.legend.setLabelTextColor(colours.text)
            for _, name in self.legend.items:  # those it has already keep their own colour else
                name.setText(name.text, color=colours.text)
            self.legend.setBrush(pg.mkBrush(QColor(colours.panel)))
            self.legend.setPen(pg.mkPen(colours.line))

    # --- drawing --------------------------------------------------------------------------------------------

    def clear_all(self) -> None:
        """Take everything away."""
        for name in list(self._items):
            self.remove(name)

    def _show_emptiness(self) -> None:
        """An empty plot says so, instead of showing axes without meaning."""
        empty = not self._items
        self._nothing.setVisible(empty)
        for side in ("bottom", "left"):
            self.getPlotItem().getAxis(side).setStyle(showValues=not empty)
        if self.legend is not None:
            self.legend.setVisible(not empty and bool(self.legend.items))

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        nothing = getattr(self, "_nothing", None)
        if nothing is not None:  # the base class resizes itself while it is made
            nothing.setGeometry(self.rect())
            self._ring.setGeometry(self.rect())

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
        """A line through points; NaN breaks it."""
        style = Qt.PenStyle.DashLine if dash else Qt.PenStyle.SolidLine
        pen = pg.mkPen(colour, width=width, style=style)
        held = self._items.get(name)
        if held and isinstance(held[0], pg.PlotDataItem):
            held[0].setData(x, y, connect="finite")
            held[0].setPen(pen)
        else:
            named = name if legend and self.legend is not None else None
            self._keep(name, self.plot(x, y, pen=pen, name=named, connect="finite"))
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
        """Points with a shape, an error bar (half its length) and words to show when the mouse is near."""
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
        named = name if legend and self.legend is not None else None
        item = pg.ScatterPlotItem(
            x=x, y=y, symbol=symbol, size=size, brush=brush, pen=pg.mkPen(colour, width=1.6), name=named
        )
        if clicked is not None:
            item.sigClicked.connect(lambda scatter, points, event: clicked(int(points[0].index())))
        self.addItem(item)
        self._keep(name, item)
        self._numbers[name] = (x, y) if error is None else (x, y, np.asarray(error))
        self._hover[name] = Series(x, y, words=words)

    def band(self, name: str, x: Column, low: Column, high: Column, colour: str) -> None:
        """A shaded stretch between two curves."""
        self.remove(name)
        shade = QColor(colour)
        shade.setAlpha(50)
        edges = [pg.PlotDataItem(x, y, pen=None) for y in (low, high)]
        fill = pg.FillBetweenItem(*edges, brush=pg.mkBrush(shade))
        fill.setZValue(-10)
        for item in (*edges, fill):
            self.addItem(item)
            self._keep(name, item)
        self._numbers[name] = (np.asarray(x), np.asarray(low), np.asarray(high))

    def bars(self, name: str, centre: Column, height: Column, width: float, colour: str) -> None:
        """A histogram."""
        self.remove(name)
        shade = QColor(colour)
        shade.setAlpha(150)
        item = pg.BarGraphItem(x=centre, height=height, width=width, brush=pg.mkBrush(shade), pen=pg.mkPen(colour))
        self.addItem(item)
        self._keep(name, item)
        self._numbers[name] = (np.asarray(centre), np.asarray(height))
        self._hover[name] = Series(np.asarray(centre), np.asarray(height))

    def upright(self, name: str, at: float, colour: str, text: str = "") -> None:
        """A vertical mark."""
        self.remove(name)
        item = pg.InfiniteLine(
            at, pen=pg.mkPen(colour, width=1.6, style=Qt.PenStyle.DashLine), label=text or None,
            labelOpts={"position": 0.92, "color": colour, "fill": pg.mkBrush(theme().panel)},
        )  # fmt: skip
        self.addItem(item)
        self._keep(name, item)
        self._numbers[name] = (np.array([at]),)

    def _keep(self, name: str, item: Any) -> None:
        first = not self._items
        self._items.setdefault(name, []).append(item)
        if first or self.legend is not None:
            self._show_emptiness()

    # --- hover, copy, export --------------------------------------------------------------------------------

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

    def _menu(self, at: QPoint) -> None:
        menu = QMenu(self)
        for text, action in (
            (tr("Show all"), self.autoRange),
            (tr("Copy picture"), lambda: QGuiApplication.clipboard().setPixmap(self.grab())),
            (tr("Copy numbers"), lambda: QGuiApplication.clipboard().setText(self.csv())),
            (tr("Save picture (PNG)…"), lambda: self._save_as("png")),
            (tr("Save drawing (SVG)…"), lambda: self._save_as("svg")),
            (tr("Save numbers (CSV)…"), lambda: self._save_as("csv")),
        ):
            menu.addAction(text).triggered.connect(action)
        menu.popup(self.mapToGlobal(at))

    def _save_as(self, suffix: str) -> None:
        name, _ = QFileDialog.getSaveFileName(self, tr("Save"), f"{self.file_name}.{suffix}", f"*.{suffix}")
        if not name:
            return
        path = Path(name)
        try:
            self.save(path if path.suffix == f".{suffix}" else path.with_name(f"{path.name}.{suffix}"))
        except DataError as error:
            QMessageBox.warning(self, "draglag", str(error))

    def save(self, path: Path) -> None:
        """Write a PNG, an SVG or a CSV, by the name's ending. Raises DataError where it cannot be written."""
        if path.suffix == ".csv":
            write_text(self.csv(), path)
        else:
            write_picture(self.getPlotItem(), path, max(1600, 2 * self.width()))

    def csv(self) -> str:
        """All numbers drawn: series, x, y and the rest, with the axes' titles as header."""
        return as_csv(self._labels[1:], self._numbers)

    @property
    def drawn(self) -> Mapping[str, tuple[Column, ...]]:
        """Name → columns of what is drawn."""
        return self._numbers
