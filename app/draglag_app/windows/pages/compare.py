"""Compare: differences between curves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QHBoxLayout,
    QSplitter,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from draglag.analysis import Analysis, analyze
from draglag.curve.compare import curve_difference
from draglag.provenance import joint_source
from draglag.shown import chance
from draglag.store import read_session
from draglag_app.windows.parts.ask_files import ask_open_several
from draglag_app.windows.parts.tasks import Progress
from draglag_app.windows.parts.theme import theme
from draglag_app.windows.parts.widgets import button, label, table
from draglag_app.windows.plots.curve_plot import SYMBOLS, CurvePlot, speeds_of
from draglag_app.windows.plots.plot import Plot, tr
from draglag_app.windows.wording import words
from draglag_app.windows.workspace import Workspace

SPEEDS_MM_S = (50.0, 100.0, 200.0, 400.0, 800.0)
# Above the curves, of their height, so that the legend covers none of them.
_FOR_LEGEND = 0.35


class ComparePage(QWidget):
    """Compares sessions with the first in the list."""

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._space = workspace
        self._shown: list[tuple[Analysis, str]] = []
        outer = QVBoxLayout(self)
        outer.setContentsMargins(12, 12, 12, 12)
        outer.setSpacing(10)
        row = QHBoxLayout()
        row.addWidget(label(self.tr("Compare"), "pageTitle"))
        row.addStretch(1)
        for text, action, role in (
            (self.tr("Add sessions…"), self._ask, "primary"),
            (self.tr("Add open session"), self._add_present, ""),
            (self.tr("Remove"), self._remove, ""),
        ):
            made = button(text, role)
            made.clicked.connect(action)
            row.addWidget(made)
        self.remove_button = made
        outer.addLayout(row)
        plots = QSplitter(Qt.Orientation.Horizontal)
        self.curves = CurvePlot(self.tr("Latency"))
        self.apart = Plot(
            self.tr("Difference from the first"), tr("drag speed (mm/s)"), tr("difference (ms)"), "difference"
        )
        self.apart.add_legend()
        plots.addWidget(self.curves)
        plots.addWidget(self.apart)
        outer.addWidget(plots, 3)
        at_speeds = [f"{speed:.0f} mm/s" for speed in SPEEDS_MM_S]
        titles = [self.tr("session"), self.tr("form"), *at_speeds, self.tr("RMS"), self.tr("differs")]
        self.table = table(titles, single=False)
        self.table.setAccessibleName(self.tr("Compare"))
        self.table.itemSelectionChanged.connect(self._chosen)
        outer.addWidget(self.table, 2)
        self.empty = label(self.tr("Add two or more sessions to see how their screens differ."), "hint")
        outer.addWidget(self.empty)
        for plot in (self.curves, self.apart):
            plot.source = self._source_line
        self._chosen()

    def _source_line(self) -> str:
        known = [analysis.source for analysis, _ in self._shown if analysis.source is not None]
        return joint_source(known).line()

    def _chosen(self) -> None:
        self.remove_button.setEnabled(self.table.selectionModel().hasSelection())

    def _ask(self) -> None:
        folder = self._space.settings.folder
        ask_open_several(self, self.tr("Add sessions"), folder, self.tr("Sessions (*.h5)"), self.add_files)

    def add_files(self, paths: list[Path]) -> None:
        """Read and analyse in a worker, then show."""

        def work(progress: Progress) -> list[tuple[Analysis, str]]:
            out = []
            for k, path in enumerate(paths):
                progress(k / len(paths), path.name)
                out.append((analyze(read_session(path)), path.name))
            return out

        if paths:
            self._space.tasks.start(
                self.tr("Reading"), work, self._add, lambda text: self._space.noticed.emit("error", text)
            )

    def _add_present(self) -> None:
        if self._space.analysis is not None:
            path = self._space.path
            self._add([(self._space.analysis, path.name if path is not None else "")])

    def _add(self, named: list[tuple[Analysis, str]]) -> None:
        self._shown += [new for new in named if all(new[0] is not old for old, _ in self._shown)]
        self._draw()

    def _remove(self) -> None:
        for index in sorted((i.row() for i in self.table.selectionModel().selectedRows()), reverse=True):
            del self._shown[index]
        self._draw()

    def _draw(self) -> None:
        self.curves.clear_all()
        self.apart.clear_all()
        self.table.setRowCount(0)
        self._chosen()
        self.empty.setVisible(len(self._shown) < 2)
        for k, (analysis, file) in enumerate(self._shown):
            self._show_one(k, analysis, file)
        self.apart.leave_room_above(_FOR_LEGEND)

    def _show_one(self, k: int, analysis: Analysis, file: str) -> None:
        colour, symbol = theme().series[k % len(theme().series)], SYMBOLS[k % len(SYMBOLS)]
        name, curve = f"{k + 1}  {analysis.session}", analysis.curve
        self.table.insertRow(k)
        row = f"{name}  ({file})" if file else name
        cells = [row, *(words.DASH for _ in range(len(SPEEDS_MM_S) + 3))]
        if curve is not None:
            self.curves.draw_curve(name, curve, colour)
            points = curve.points
            if points is not None:
                runs = name + tr(", runs")
                self.curves.dots(runs, points.speed_mm_s, 1e3 * points.latency_s, colour, symbol, 8, legend=False)
            speeds = np.array(SPEEDS_MM_S)
            predicted = 1e3 * curve.predict_s(speeds)
            inside = curve.inside(speeds)
            figures = [f"{ms:.1f} ms" if ok else words.DASH for ms, ok in zip(predicted, inside, strict=True)]
            cells = [row, words.form_name(curve.form), *figures, f"{1e3 * curve.rms_s:.2f} ms", words.DASH]
        for column, text in enumerate(cells):
            self.table.setItem(k, column, QTableWidgetItem(text))
        first = self._shown[0][0].curve
        if k and curve is not None and first is not None:
            found = curve_difference(first, curve, speeds_of(curve))
            if found is not None:
                speed = found.speed_mm_s
                self.apart.band(name + " 95 %", speed, 1e3 * found.low_s, 1e3 * found.high_s, colour)
                self.apart.line(name, speed, 1e3 * found.difference_s, colour, 2.5)
                answer = self.tr("yes") if found.p_value < 0.05 else self.tr("no")
                self.table.setItem(k, len(cells) - 1, QTableWidgetItem(f"{answer} ({chance(found.p_value)})"))

    def restyle_plots(self) -> None:
        """Draw in the present theme."""
        self.curves.restyle()
        self.apart.restyle()
        self._draw()
