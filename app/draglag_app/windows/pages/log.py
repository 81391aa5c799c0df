"""Log: all notices."""

from __future__ import annotations

from datetime import datetime

from PySide6.QtCore import Qt
from PySide6.QtGui import QBrush, QColor, QGuiApplication
from PySide6.QtWidgets import (
    QComboBox,
    QHBoxLayout,
    QHeaderView,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from draglag_app.session import events
from draglag_app.windows.parts.theme import theme, wide
from draglag_app.windows.parts.widgets import button, label, table
from draglag_app.windows.wording import words
from draglag_app.windows.wording.i18n import QT_TRANSLATE_NOOP
from draglag_app.windows.wording.library_words import fault_words, in_words, source_name
from draglag_app.windows.workspace import Workspace

_LEVELS = {
    "info": ("·", QT_TRANSLATE_NOOP("LogPage", "info")),
    "note": ("✎", QT_TRANSLATE_NOOP("LogPage", "note")),
    "warning": ("▲", QT_TRANSLATE_NOOP("LogPage", "warning")),
    "error": ("✕", QT_TRANSLATE_NOOP("LogPage", "error")),
}
_MOST_ROWS = 5000


class LogPage(QWidget):
    """A table of notices, filtered by level."""

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._space = workspace
        outer = QVBoxLayout(self)
        outer.setContentsMargins(16, 16, 16, 16)
        outer.setSpacing(10)
        row = QHBoxLayout()
        row.addWidget(label(self.tr("Log"), "pageTitle"))
        row.addStretch(1)
        self.level = QComboBox()
        self.level.setAccessibleName(self.tr("level"))
        for value, text in (
            ("info", self.tr("Everything")),
            ("note", self.tr("Notes, warnings, errors")),
            ("warning", self.tr("Warnings and errors")),
            ("error", self.tr("Errors")),
        ):
            self.level.addItem(text, value)
        self.level.activated.connect(self._filter)
        row.addWidget(self.level)
        copy = button(self.tr("Copy all"))
        copy.clicked.connect(self._copy)
        row.addWidget(copy)
        outer.addLayout(row)
        titles = [self.tr("time"), self.tr("level"), self.tr("from"), self.tr("what")]
        self.table = table(titles, stretch=3, single=False)
        self.table.setAlternatingRowColors(True)
        self.table.setAccessibleName(self.tr("Log"))
        for column, width in enumerate((100, 140, 130)):
            self.table.horizontalHeader().setSectionResizeMode(column, QHeaderView.ResizeMode.Interactive)
            self.table.horizontalHeader().resizeSection(column, wide(width))
        outer.addWidget(self.table, 1)
        bridge = workspace.bridge
        bridge.notice_raised.connect(lambda event: self.add(event.level, event.source, in_words(event.text)))
        bridge.device_opened.connect(
            lambda event: self.add("info", event.role, f"{event.address} {in_words(event.description)}")
        )
        bridge.device_fault.connect(
            lambda event: self.add("error", event.role, fault_words(event.problem, event.remedy))
        )
        bridge.run_finished.connect(self._run_finished)
        bridge.session_finished.connect(
            lambda event: self.add("info", "file", f"{event.path} {in_words(event.problem)}")
        )
        workspace.noticed.connect(lambda level, text: self.add(level, "draglag", in_words(text)))
        workspace.session_changed.connect(self._session_changed)

    def add(self, level: str, source: str, text: str) -> None:
        """Add a line with the present time."""
        if self.table.rowCount() >= _MOST_ROWS:
            self.table.removeRow(0)
        row = self.table.rowCount()
        self.table.insertRow(row)
        colours = {"warning": theme().warning, "error": theme().bad}
        now = datetime.now().strftime("%H:%M:%S")
        mark, name = _LEVELS.get(level, ("·", level))
        for column, cell in enumerate((now, f"{mark} {self.tr(name)}", source_name(source), text)):
            item = QTableWidgetItem(cell)
            item.setData(Qt.ItemDataRole.UserRole, level)
            if level in colours and column == 1:
                item.setForeground(QBrush(QColor(colours[level])))
            self.table.setItem(row, column, item)
        self._filter_row(row)
        self.table.scrollToBottom()

    def _run_finished(self, event: events.RunFinished) -> None:
        touch, edges = len(event.run.touch.t_s), len(event.run.laser.t_s)
        text = self.tr("{outcome}: {touch} touch events, {edges} edges").format(
            outcome=words.outcome_name(event.outcome), touch=touch, edges=edges
        )
        self.add("info" if event.outcome == "complete" else "warning", event.run.id, text)

    def _session_changed(self) -> None:
        session = self._space.session
        if session is None or self._space.recording.order is not None:
            return
        self.add("info", "file", session.name)
        for entry in session.notes:
            self.add(entry.level, entry.source, in_words(entry.text))
        for run in session.runs:
            for entry in run.log:
                self.add(entry.level, f"{run.id} {source_name(entry.source)}", in_words(entry.text))

    def _filter(self) -> None:
        for row in range(self.table.rowCount()):
            self._filter_row(row)

    def _filter_row(self, row: int) -> None:
        order = list(_LEVELS)
        item = self.table.item(row, 1)
        level = item.data(Qt.ItemDataRole.UserRole) if item is not None else "info"
        hidden = order.index(level) < order.index(str(self.level.currentData())) if level in order else False
        self.table.setRowHidden(row, hidden)

    def _copy(self) -> None:
        lines = []
        for row in range(self.table.rowCount()):
            cells = [self.table.item(row, column) for column in range(4)]
            lines.append("\t".join(cell.text() for cell in cells if cell is not None))
        QGuiApplication.clipboard().setText("\n".join(lines))
