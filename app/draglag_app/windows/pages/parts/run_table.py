"""The table of runs on the Record and Results pages."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

from PySide6.QtCore import QCoreApplication, Qt, Signal
from PySide6.QtGui import QBrush, QColor
from PySide6.QtWidgets import QHeaderView, QTableWidget, QTableWidgetItem, QWidget

from draglag.latency import RunEstimate
from draglag.recording import Run
from draglag_app.windows.parts.plain import plain
from draglag_app.windows.parts.theme import theme
from draglag_app.windows.parts.widgets import set_up_table
from draglag_app.windows.wording import words

_MARK = {"ok": "✓ ", "warning": "▲ ", "bad": "✕ ", "": ""}


def tr(text: str) -> str:
    return QCoreApplication.translate("RunTable", text)


class RunTable(QTableWidget):
    """One row a run: id, target, speed, latency, edges, verdict."""

    run_selected = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        titles = [tr("run"), tr("target"), tr("speed (mm/s)"), tr("latency"), tr("edges"), tr("verdict")]
        super().__init__(parent)
        set_up_table(self, titles, stretch=len(titles) - 1)
        self.setAlternatingRowColors(True)
        self.setAccessibleName(tr("Runs"))
        for column in (2, 3, 4):
            item = self.horizontalHeaderItem(column)
            if item is not None:
                item.setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self.itemSelectionChanged.connect(self._selected)

    def tell_first(self) -> None:
        """Latency and verdict beside the run, where not all columns find room: the others are scrolled to."""
        header = self.horizontalHeader()
        header.setSectionResizeMode(header.count() - 1, QHeaderView.ResizeMode.ResizeToContents)
        for place, column in enumerate((0, 3, 5, 2, 1, 4)):
            header.moveSection(header.visualIndex(column), place)

    def clear_runs(self) -> None:
        self.setRowCount(0)

    def add_run(self, run: Run, outcome: str = "complete") -> None:
        """A run just recorded; its estimate follows. Told again of a run, the table keeps its row."""
        known = [row for row in range(self.rowCount()) if self._id(row) == run.id]
        if known and outcome == "complete":
            return  # the estimate is there or on its way
        row = known[0] if known else self.rowCount()
        if not known:
            self.insertRow(row)
        if outcome != "complete":
            level, text = "bad", words.outcome_name(outcome)
        elif run.protocol in ("circle", "free"):
            level, text = "", tr("estimating…")
        else:
            level, text = "", tr("for validation")
        self._fill(
            row,
            (run.id, words.target_name(run.protocol), words.number(run.nominal_speed_mm_s, 0), words.DASH,
             str(len(run.laser.t_s)), text),
            level,
        )  # fmt: skip
        self.scrollToBottom()

    def show_estimates(
        self,
        estimates: Iterable[RunEstimate],
        excluded: Mapping[str, str] | None = None,
        preliminary: Collection[str] = (),
    ) -> None:
        """Fill in latency and verdict of the runs in the table; ``preliminary`` ones are not judged yet."""
        rows = {self._id(row): row for row in range(self.rowCount())}
        for estimate in estimates:
            row = rows.get(estimate.id)
            if row is None:
                continue
            level, text = words.verdict(estimate)
            if estimate.id in preliminary and estimate.latency_s is not None:
                level, text = "", tr("preliminary")
            if excluded and estimate.id in excluded:
                level, text = "", tr("excluded: {why}").format(why=excluded[estimate.id])
            speed = estimate.speed_mm_s if estimate.speed_mm_s is not None else estimate.nominal_speed_mm_s
            edges = f"{estimate.n_edges}" + (f" (+{estimate.n_rejected})" if estimate.n_rejected else "")
            self._fill(
                row,
                (estimate.id, words.target_name(estimate.protocol), words.number(speed, 0),
                 words.latency_text(estimate), edges, text),
                level,
                words.flag_meanings(estimate.flags),
            )  # fmt: skip

    def select(self, run_id: str) -> None:
        for row in range(self.rowCount()):
            if self._id(row) == run_id:
                self.selectRow(row)
                return

    def _fill(self, row: int, texts: tuple[str, ...], level: str, tip: str = "") -> None:
        colours = {"ok": theme().ok, "warning": theme().warning, "bad": theme().bad}
        for column, text in enumerate(texts):
            last = column == len(texts) - 1
            item = QTableWidgetItem(_MARK[level] + text if last else text)
            if last and level:
                item.setForeground(QBrush(QColor(colours[level])))
            if column in (2, 3, 4):
                item.setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
            item.setToolTip(plain(tip))
            self.setItem(row, column, item)

    def _selected(self) -> None:
        rows = self.selectionModel().selectedRows()
        if rows:
            self.run_selected.emit(self._id(rows[0].row()))

    def _id(self, row: int) -> str:
        item = self.item(row, 0)
        return item.text() if item is not None else ""
