"""Axes, focus, legend, menu of a plot."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import pyqtgraph as pg
from PySide6.QtCore import QCoreApplication, QPoint, QRectF, QSize, Qt, QTimer
from PySide6.QtGui import QColor, QFocusEvent, QFont, QFontMetrics, QGuiApplication, QKeyEvent, QResizeEvent
from PySide6.QtWidgets import QFrame, QLabel, QMessageBox, QSizePolicy, QWidget

from draglag.errors import DataError
from draglag.provenance import Source
from draglag_app.windows.parts.ask_files import ask_save
from draglag_app.windows.parts.letter_menu import LetterMenu
from draglag_app.windows.parts.plain import plain
from draglag_app.windows.parts.theme import points, theme
from draglag_app.windows.plots.axis import BEHIND_VIEW, Axis
from draglag_app.windows.plots.plot_values import Column, as_csv, signed, write_picture, write_text
from draglag_app.windows.wording.library_words import in_words


def tr(text: str) -> str:
    return QCoreApplication.translate("Plot", text)


_MARGIN_PX = 16
# Between the names in a title. Letters smaller than so many points are not read; a plot so high has room for lines.
_APART = " &nbsp; "
_LEGIBLE_PT, _HIGH_PX = 7.5, 220
# Smaller than this, axes and titles leave nothing for what is drawn.
_LEAST_PX = (200, 150)
# The keyboard was with a menu or with another window in the meantime.
_AWAY = (Qt.FocusReason.PopupFocusReason, Qt.FocusReason.ActiveWindowFocusReason, Qt.FocusReason.MenuBarFocusReason)


class PlotFrame(pg.PlotWidget):
    """The surroundings of a plot; subclasses draw."""

    def __init__(self, title: str, x: str, y: str, file_name: str, parent: QWidget | None) -> None:
        super().__init__(parent, enableMenu=False, axisItems={side: Axis(side) for side in ("bottom", "left")})
        # Its menu is not shown, but holds the switches of the grid, and belongs to nobody.
        menu = self.getPlotItem().ctrlMenu
        menu.setParent(self, menu.windowFlags())
        for side in ("bottom", "left"):
            axis = self.getPlotItem().getAxis(side)
            axis.setZValue(BEHIND_VIEW)
            axis.setStyle(maxTickLevel=0)  # lines where numbers stand, all alike
        self.file_name = file_name
        self.source: Callable[[], str] | None = None
        self.setAccessibleName(title or f"{y} / {x}")
        self._labels: tuple[str, str, str] = (title, x, y)
        self._title: tuple[str, ...] = ()
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(*_LEAST_PX)
        self.hideButtons()
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        self.customContextMenuRequested.connect(self._menu)
        self._tip = pg.TextItem("", anchor=(0, 1))
        self._tip.setZValue(50)
        self.getPlotItem().vb.addItem(self._tip, ignoreBounds=True)
        self._tip.hide()
        self.legend: Any = None
        self._nothing = QLabel(tr("nothing yet"), self)
        self._nothing.setTextFormat(Qt.TextFormat.PlainText)
        self._nothing.setObjectName("hint")
        self._nothing.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._nothing.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        # A border of its own would push the axes out of sight.
        self._ring = QFrame(self)
        self._ring.setObjectName("focusRing")
        self._ring.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self._ring.hide()
        self._by_tab = False
        self._items: dict[str, list[Any]] = {}
        self._numbers: dict[str, tuple[Column, ...]] = {}
        # Not within the change of size itself, which has a layout of its own under way.
        self._resized = QTimer(self)
        self._resized.setSingleShot(True)
        self._resized.timeout.connect(self._fit_titles)
        self.restyle()
        self._show_emptiness()

    def sizeHint(self) -> QSize:
        """The minimum: a graphics view would ask for much."""
        return QSize(self.minimumSize())

    def focusInEvent(self, event: QFocusEvent) -> None:
        super().focusInEvent(event)
        if event.reason() not in _AWAY:
            self._by_tab = event.reason() in (Qt.FocusReason.TabFocusReason, Qt.FocusReason.BacktabFocusReason)
        self._ring.setVisible(self._by_tab)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            self._menu(self.rect().center())
            event.accept()
            return
        super().keyPressEvent(event)

    def focusOutEvent(self, event: QFocusEvent) -> None:
        super().focusOutEvent(event)
        self._ring.hide()

    def _tick_font(self) -> QFont:
        font = QFont(self.font())
        font.setPointSizeF(float(points(9).removesuffix("pt")))
        return font

    # --- legend and titles ----------------------------------------------------------------------------------

    def add_legend(self, offset: tuple[int, int] = (-10, 8), columns: int = 1) -> None:
        """Add a legend in a corner."""
        self.legend = self.addLegend(offset=offset, labelTextSize=points(9), colCount=columns)
        self.restyle()
        self._show_emptiness()

    def name_above(self, title: str, marks: Iterable[tuple[str, str, str]], apart: str = _APART) -> None:
        """Set a title that includes the legend, (sign, colour, words) each; HTML."""
        words = _APART.join(f"<span style='color:{colour}'>{sign}</span> {text}" for sign, colour, text in marks)
        self.title_lines(f"{title}{apart}{words}".split("<br>"))

    def title_lines(self, lines: Sequence[str]) -> None:
        """Set a title of HTML lines."""
        self._title = tuple(lines)
        self._write_title()

    def _write_title(self) -> None:
        plot, lines = self.getPlotItem(), self._title
        room = self.width() - plot.getAxis("left").width() - _MARGIN_PX
        size_pt = self._set_title(lines, room)
        if size_pt < _LEGIBLE_PT and self.height() >= _HIGH_PX:  # every name in a line of its own
            lines = tuple(part for line in lines for part in line.split(_APART))
            self._set_title(lines, room)
        if len(lines) > 1:
            high = QFontMetrics(self._tick_font()).height() * len(lines) + 12
            plot.titleLabel.setMaximumHeight(high)
            plot.layout.setRowFixedHeight(0, high)

    def _set_title(self, lines: Sequence[str], room_px: float) -> float:
        plot = self.getPlotItem()
        # A title has no width of its own to centre lines in; a table has.
        rows = "".join(f"<tr><td align='center'>{line}</td></tr>" for line in lines)
        text = f"<table cellspacing='0'>{rows}</table>" if len(lines) > 1 else "".join(lines)
        plot.setTitle(text, color=theme().text, size=points(10))
        asked = float(plot.titleLabel.item.boundingRect().width())
        if asked <= room_px:
            return 10.0
        size_pt = max(4.0, 9.8 * room_px / asked)
        plot.setTitle(text, color=theme().text, size=points(size_pt))
        return size_pt

    def _fit_titles(self) -> None:
        plot = self.getPlotItem()
        if plot is None:  # a plot that was closed has none
            return
        self._write_axes()
        if self._title:
            self._write_title()
            plot.layout.activate()
            plot.setGeometry(QRectF(self.viewport().rect()))  # what a longer title had pushed out

    def rename(self, title: str) -> None:
        """Set the title."""
        self._labels = (title, *self._labels[1:])
        self.restyle()

    def relabel(self, title: str, x: str, y: str) -> None:
        """Set title and axes."""
        self._labels = (title, x, y)
        self.restyle()

    def restyle(self) -> None:
        """Draw in the present theme."""
        colours = theme()
        self.setBackground(colours.panel)
        plot = self.getPlotItem()
        if self._labels[0]:
            self.title_lines([self._labels[0]])
        self._write_axes()
        for side in ("bottom", "left"):
            axis = plot.getAxis(side)
            axis.setTickFont(self._tick_font())
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

    def _write_axes(self) -> None:
        _, x, y = self._labels
        self.getPlotItem().getAxis("bottom").write(x, self.width())
        self.getPlotItem().getAxis("left").write(y, self.height())

    def say_empty(self, text: str = "") -> None:
        """Words in place of data while there are none; empty: the usual ones."""
        self._nothing.setText(text or tr("nothing yet"))

    def _show_emptiness(self) -> None:
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
            if event.oldSize() != event.size():
                self._resized.start(0)

    # --- copy and export ------------------------------------------------------------------------------------

    def _menu(self, at: QPoint) -> None:
        menu = LetterMenu(self)
        for text, action in (
            (tr("Show all"), self.autoRange),
            (tr("Copy picture"), self._copy),
            (tr("Copy numbers"), lambda: QGuiApplication.clipboard().setText(self.csv())),
            (tr("Save picture (PNG)…"), lambda: self._save_as("png")),
            (tr("Save drawing (SVG)…"), lambda: self._save_as("svg")),
            (tr("Save numbers (CSV)…"), lambda: self._save_as("csv")),
        ):
            menu.addAction(text).triggered.connect(action)
        menu.popup(self.mapToGlobal(at))

    def _save_as(self, suffix: str) -> None:
        ask_save(self, tr("Save"), f"{self.file_name}.{suffix}", f"*.{suffix}", self._save_to)

    def _save_to(self, path: Path) -> None:
        try:
            self.save(path)
        except DataError as error:
            self._tell("error", error.message)
        else:
            self._tell("info", tr("Saved: {path}").format(path=path))

    def _tell(self, level: str, text: str) -> None:
        notify = getattr(self.window(), "notify", None)
        if notify is not None:
            notify(level, text)
        elif level == "error":
            QMessageBox.warning(self, "draglag", plain(in_words(text)))

    def source_line(self) -> str:
        """The source, for exported pictures."""
        if self.source is not None:
            return self.source()
        of_window = getattr(self.window(), "figure_source", None)
        return of_window() if of_window is not None else Source(tr("no session"), "", simulated=False).line()

    def _copy(self) -> None:
        QGuiApplication.clipboard().setImage(signed(self.grab().toImage(), self.source_line()))

    def save(self, path: Path) -> None:
        """Write PNG, SVG or CSV, by the ending. Raises DataError."""
        if path.suffix == ".csv":
            write_text(self.csv(), path)
        else:
            write_picture(self.getPlotItem(), path, max(1600, 2 * self.width()), self.source_line())

    def csv(self) -> str:
        """All numbers drawn."""
        return as_csv(self._labels[1:], self._numbers)
