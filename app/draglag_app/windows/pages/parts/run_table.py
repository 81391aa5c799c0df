"""The table of runs."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager

from PySide6.QtCore import QCoreApplication, Qt, Signal
from PySide6.QtGui import QBrush, QColor, QResizeEvent
from PySide6.QtWidgets import QHeaderView, QTableWidget, QTableWidgetItem, QWidget

from draglag.latency import RunEstimate
from draglag.latency.steady import has_constant_speed
from draglag.recording import Run
from draglag_app.windows.parts.plain import plain
from draglag_app.windows.parts.theme import theme, wide
from draglag_app.windows.parts.widgets import set_up_table
from draglag_app.windows.wording import words

_MARK = {"ok": "✓ ", "warning": "▲ ", "bad": "✕ ", "": ""}


def tr(text: str) -> str:
    return QCoreApplication.translate("RunTable", text)


_VERDICT, COMMENT = 5, 6
"""Columns."""
_NARROW_PX = 580  # with less, verdicts would be out of sight
_NOTHING = 2  # rank of a cell without a value, after numbers and texts
_NUMBER = re.compile(r"-?\d+(\.\d+)?")


class Cell(QTableWidgetItem):
    """A cell sorted by the number its text begins with, else by text."""

    def __init__(self, text: str, key: str) -> None:
        super().__init__(text)
        found = _NUMBER.match(key)
        self.key = (0, float(found.group()), key) if found else (_NOTHING if key in ("", words.DASH) else 1, 0.0, key)

    def __lt__(self, other: object) -> bool:
        if not isinstance(other, Cell):
            return False
        if (self.key[0] == _NOTHING) != (other.key[0] == _NOTHING):  # what is missing comes last in either order
            table = self.tableWidget()
            down = table is not None and table.horizontalHeader().sortIndicatorOrder() == Qt.SortOrder.DescendingOrder
            return (self.key[0] == _NOTHING) == down
        return self.key < other.key


class RunTable(QTableWidget):
    """A row per run."""

    run_selected = Signal(str)

    def __init__(self, parent: QWidget | None = None, browsed: bool = False) -> None:
        """``browsed``: with comments, and sortable."""
        titles = [tr("run"), tr("target"), tr("speed (mm/s)"), tr("latency"), tr("edges"), tr("verdict")]
        if browsed:
            titles.append(tr("comment"))
        super().__init__(parent)
        self._browsed, self._words = browsed, ""
        set_up_table(self, titles, stretch=len(titles) - 1)
        self.setAlternatingRowColors(True)
        self.setAccessibleName(tr("Runs"))
        for column in (2, 3, 4):
            item = self.horizontalHeaderItem(column)
            if item is not None:
                item.setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self.itemSelectionChanged.connect(self._selected)
        if browsed:
            self.horizontalHeader().setSortIndicatorShown(True)
            self.horizontalHeader().setSortIndicator(0, Qt.SortOrder.AscendingOrder)
            self.setSortingEnabled(True)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        if not self._browsed and self.width() < wide(_NARROW_PX):
            self.show_first_columns()

    def show_first_columns(self) -> None:
        """Put latency and verdict next to the run."""
        header = self.horizontalHeader()
        header.setSectionResizeMode(header.count() - 1, QHeaderView.ResizeMode.ResizeToContents)
        for place, column in enumerate((0, 3, 5, 2, 1, 4)):
            header.moveSection(header.visualIndex(column), place)

    def keep_those_with(self, text: str) -> None:
        """Show runs with these words in any column."""
        self._words = text.casefold()
        for row in range(self.rowCount()):
            cells = [self.item(row, column) for column in range(self.columnCount())]
            said = " ".join(cell.text() for cell in cells if cell is not None).casefold()
            self.setRowHidden(row, not all(word in said for word in self._words.split()))

    def show_comments(self, comments: Mapping[str, str]) -> None:
        """Show comments, run → text."""
        with self._order_kept():
            for row in range(self.rowCount()):
                text = comments.get(self._id(row), "")
                item = Cell(text, text)
                item.setToolTip(plain(text))
                self.setItem(row, COMMENT, item)

    def bring_comment(self, run_id: str) -> None:
        """Scroll to the comment on a run."""
        for row in range(self.rowCount()):
            if self._id(row) == run_id:
                self.scrollTo(self.model().index(row, COMMENT))

    @contextmanager
    def _order_kept(self) -> Iterator[None]:
        sorting = self.isSortingEnabled()
        self.setSortingEnabled(False)
        try:
            yield
        finally:
            self.setSortingEnabled(sorting)
            if self._browsed:
                self.keep_those_with(self._words)

    def clear_runs(self) -> None:
        self.setRowCount(0)

    def add_run(self, run: Run, outcome: str = "complete") -> None:
        """Add a run; a known one keeps its row."""
        with self._order_kept():
            self._add_run(run, outcome)
        self.scrollToBottom()

    def _add_run(self, run: Run, outcome: str) -> None:
        known = [row for row in range(self.rowCount()) if self._id(row) == run.id]
        if known and outcome == "complete":
            return  # the estimate is there or on its way
        row = known[0] if known else self.rowCount()
        if not known:
            self.insertRow(row)
        if outcome != "complete":
            level, text = "bad", words.outcome_name(outcome)
        elif has_constant_speed(run):
            level, text = "", tr("estimating…")
        else:
            level, text = "", tr("for validation")
        self._fill(
            row,
            (run.id, words.target_name(run.protocol), words.number(run.nominal_speed_mm_s, 0), words.DASH,
             str(len(run.laser.t_s)), text),
            level,
        )  # fmt: skip

    def show_estimates(
        self,
        estimates: Iterable[RunEstimate],
        excluded: Mapping[str, str] | None = None,
        preliminary: Collection[str] = (),
    ) -> None:
        """Fill in estimates; ``preliminary`` ones are not judged."""
        with self._order_kept():
            self._show_estimates(estimates, excluded or {}, preliminary)

    def _show_estimates(
        self, estimates: Iterable[RunEstimate], excluded: Mapping[str, str], preliminary: Collection[str]
    ) -> None:
        rows = {self._id(row): row for row in range(self.rowCount())}
        for estimate in estimates:
            row = rows.get(estimate.id)
            if row is None:
                continue
            level, text = words.verdict(estimate)
            if estimate.id in preliminary and estimate.latency_s is not None:
                level, text = "", tr("preliminary")
            if estimate.id in excluded:
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

    def show_repeated(self, repeated: Mapping[str, str]) -> None:
        """Say of runs that failed which run was recorded in their place, run → run."""
        with self._order_kept():
            for row in range(self.rowCount()):
                run_id = self._id(row)
                if run_id in repeated:
                    failed = self.item(row, _VERDICT)
                    why = failed.text() if failed is not None else ""
                    self._judge(row, "", tr("repeated as {run}").format(run=repeated[run_id]), why)

    def select(self, run_id: str) -> None:
        for row in range(self.rowCount()):
            if self._id(row) == run_id:
                self.selectRow(row)
                return

    def _fill(self, row: int, texts: tuple[str, ...], level: str, tip: str = "") -> None:
        for column, text in enumerate(texts[:-1]):
            item = Cell(text, text)
            if column in (2, 3, 4):
                item.setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
            item.setToolTip(plain(tip))
            self.setItem(row, column, item)
        self._judge(row, level, texts[-1], tip)

    def _judge(self, row: int, level: str, text: str, tip: str = "") -> None:
        colours = {"ok": theme().ok, "warning": theme().warning, "bad": theme().bad}
        item = Cell(_MARK[level] + text, text)
        if level:
            item.setForeground(QBrush(QColor(colours[level])))
        item.setToolTip(plain(tip))
        self.setItem(row, _VERDICT, item)

    def _selected(self) -> None:
        rows = self.selectionModel().selectedRows()
        if rows:
            self.run_selected.emit(self._id(rows[0].row()))

    def _id(self, row: int) -> str:
        item = self.item(row, 0)
        return item.text() if item is not None else ""
