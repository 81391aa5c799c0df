"""Fields of a whole protocol."""

from __future__ import annotations

from typing import Any

from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QDoubleSpinBox,
    QHBoxLayout,
    QLineEdit,
    QSpinBox,
    QWidget,
)

from draglag.protocol.runs import Protocol
from draglag_app.windows.parts.widgets import Form, Panel
from draglag_app.windows.workspace import Workspace


class ProtocolForm(Panel):
    """Every edit is undoable."""

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__("", parent)
        self._space = workspace
        self._filling = False
        form = Form()
        self.name = QLineEdit()
        self.shuffle = QCheckBox(self.tr("shuffle, seed"))
        self.seed = QSpinBox()
        self.seed.setRange(0, 1_000_000)
        self.rest = QDoubleSpinBox()
        self.rest.setRange(0, 3600)
        self.rest.setDecimals(0)
        self.rest.setSuffix(" s")
        self.seed.setAccessibleName(self.tr("shuffle, seed"))
        self.taps = QSpinBox()
        self.taps.setAccessibleName(self.tr("Taps"))
        self.taps.setRange(0, 10_000)
        self.taps.setSpecialValueText(self.tr("none"))
        self.when = QComboBox()
        self.when.setAccessibleName(self.tr("Taps"))
        for value, text in (
            ("start", self.tr("before")),
            ("end", self.tr("after")),
            ("both", self.tr("before and after")),
        ):
            self.when.addItem(text, value)
        self.check = QDoubleSpinBox()
        self.check.setRange(0, 3600)
        self.check.setDecimals(0)
        self.check.setSuffix(" s")
        self.check.setSpecialValueText(self.tr("none"))
        form.row(self.tr("Name"), self.name)
        form.row(self.tr("Order"), _in_a_row(self.shuffle, self.seed))
        form.row(self.tr("Rest between runs"), self.rest)
        form.row(self.tr("Taps"), _in_a_row(self.taps, self.when))
        form.row(self.tr("Clock check"), self.check)
        self.body.addLayout(form)
        self.name.editingFinished.connect(self._edited)
        self.shuffle.clicked.connect(self._edited)
        self.when.activated.connect(self._edited)
        for spin in (self.seed, self.rest, self.taps, self.check):
            spin.setKeyboardTracking(False)
            spin.valueChanged.connect(self._edited)

    def refresh(self) -> None:
        """Show the protocol."""
        protocol = self._space.protocol
        self._filling = True
        self.name.setText(protocol.name)
        self.shuffle.setChecked(protocol.shuffle)
        self.seed.setValue(protocol.seed)
        self.rest.setValue(protocol.rest_s)
        self.taps.setValue(protocol.taps.count if protocol.taps else 0)
        self.when.setCurrentIndex(self.when.findData(protocol.taps.when if protocol.taps else "end"))
        self.when.setEnabled(protocol.taps is not None)
        self.check.setValue(protocol.clock_check.duration_s if protocol.clock_check else 0)
        self._filling = False

    def _edited(self) -> None:
        if self._filling:
            return
        present = self._space.protocol.model_dump()
        changes: dict[str, Any] = {
            "name": self.name.text().strip() or self._space.protocol.name,
            "shuffle": self.shuffle.isChecked(),
            "seed": self.seed.value(),
            "rest_s": self.rest.value(),
            "taps": None,
            "clock_check": None,
        }
        if self.taps.value():
            known = present["taps"] or {}
            changes["taps"] = {**known, "count": self.taps.value(), "when": self.when.currentData()}
        if self.check.value():
            changes["clock_check"] = {**(present["clock_check"] or {}), "duration_s": self.check.value()}
        try:
            protocol = Protocol.model_validate({**present, **changes})
        except ValueError:
            self._space.noticed.emit("warning", self.tr("A protocol needs at least one run, taps or a clock check."))
            self.refresh()
            return
        self._space.change_protocol(protocol, self.tr("edit the protocol"))


def _in_a_row(*widgets: QWidget) -> QHBoxLayout:
    row = QHBoxLayout()
    row.setSpacing(8)
    for widget in widgets:
        row.addWidget(widget, 1)
    return row
