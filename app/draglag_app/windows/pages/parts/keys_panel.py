"""Keys of every action."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeySequence
from PySide6.QtWidgets import QKeySequenceEdit, QTableWidgetItem

from draglag_app.windows.actions import ACTIONS, keys_of, say, who_has
from draglag_app.windows.parts.flow import Flow
from draglag_app.windows.parts.widgets import Panel, button, label, table
from draglag_app.windows.workspace import Workspace

_HIGH_PX = 260


class KeysPanel(Panel):
    """A row per action; a field changes its keys."""

    def __init__(self, workspace: Workspace) -> None:
        super().__init__()
        self.title.setText(self.tr("Keys"))
        self.title.show()
        self.body.addWidget(self.title)
        self._space = workspace
        self.table = table([self.tr("action"), self.tr("keys")], stretch=0)
        self.table.setAccessibleName(self.tr("Keys"))
        self.table.setMinimumHeight(_HIGH_PX)
        self.table.setRowCount(len(ACTIONS))
        for place, spec in enumerate(ACTIONS):
            item = QTableWidgetItem(say(spec.text))
            item.setData(Qt.ItemDataRole.UserRole, spec.id)
            self.table.setItem(place, 0, item)
        self.table.itemSelectionChanged.connect(self._chosen)
        self.body.addWidget(self.table)
        row = Flow()
        self.edit = QKeySequenceEdit()
        self.edit.setMaximumSequenceLength(1)
        self.edit.setAccessibleName(self.tr("New keys"))
        self.apply = button(self.tr("Use these keys"))
        self.apply.clicked.connect(lambda: self.use(self.edit.keySequence().toString()))
        self.reset = button(self.tr("Reset"))
        self.reset.clicked.connect(self._reset)
        self.reset_all = button(self.tr("Reset all"))
        self.reset_all.clicked.connect(lambda: workspace.change_settings(keys={}))
        row.addWidget(label(self.tr("New keys")))
        row.addWidget(self.edit)
        row.addWidget(self.apply)
        row.add_rest()
        row.add_together(self.reset, self.reset_all)
        self.body.addLayout(row)
        workspace.settings_changed.connect(self.refresh)
        self.refresh()

    @property
    def action(self) -> str:
        """The selected action's id, or ""."""
        rows = self.table.selectionModel().selectedRows()
        item = self.table.item(rows[0].row(), 0) if rows else None
        return "" if item is None else str(item.data(Qt.ItemDataRole.UserRole))

    def refresh(self) -> None:
        """Show the present keys."""
        chosen = self._space.settings.keys
        for place, spec in enumerate(ACTIONS):
            self.table.setItem(place, 1, QTableWidgetItem(keys_of(spec.id, chosen)))
        self._chosen()

    def use(self, keys: str) -> None:
        """Use these keys, unless another action has them."""
        action, chosen = self.action, self._space.settings.keys
        if not action or not keys:
            return
        other = who_has(keys, chosen)
        if other and other != action:
            text = next(say(spec.text) for spec in ACTIONS if spec.id == other)
            said = self.tr("{keys} belongs to “{action}”: choose others.").format(keys=keys, action=text)
            self._space.noticed.emit("warning", said)
            return
        self._space.change_settings(keys={**chosen, action: keys})

    def _reset(self) -> None:
        kept = {action: keys for action, keys in self._space.settings.keys.items() if action != self.action}
        self._space.change_settings(keys=kept)

    def _chosen(self) -> None:
        there = bool(self.action)
        for made in (self.edit, self.apply, self.reset):
            made.setEnabled(there)
        self.edit.setKeySequence(QKeySequence(keys_of(self.action, self._space.settings.keys)))
