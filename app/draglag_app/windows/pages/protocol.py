"""Protocol: the runs, their duration and precision."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtWidgets import (
    QHBoxLayout,
    QPushButton,
    QSizePolicy,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from draglag.errors import DraglagError
from draglag.protocol.runs import Protocol, RunPlan, load_protocol
from draglag.system.temporary import new_file
from draglag_app.windows.pages.parts.plan_editor import PlanEditor
from draglag_app.windows.pages.parts.plan_preview import PlanPreview
from draglag_app.windows.pages.parts.precision_preview import PrecisionPreview
from draglag_app.windows.pages.parts.preset_menu import PresetMenu
from draglag_app.windows.pages.parts.protocol_form import ProtocolForm
from draglag_app.windows.parts.ask_files import ask_open, ask_save
from draglag_app.windows.parts.columns import Columns
from draglag_app.windows.parts.flow import Flow
from draglag_app.windows.parts.letter_menu import LetterMenu
from draglag_app.windows.parts.plain import plain
from draglag_app.windows.parts.theme import wide
from draglag_app.windows.parts.widgets import LARGE_TEXT, Panel, Scrolled, button, label, table
from draglag_app.windows.protocol_text import to_toml
from draglag_app.windows.wording import words
from draglag_app.windows.workspace import Workspace

# Heights; that of a plot is for large text.
_TABLE_PX, _PLOT_PX = 140, 160
KINDS = ("circle", "chirp", "multisine", "step")


class ProtocolPage(QWidget):
    """Every edit makes a new, checked protocol; undoable."""

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._space = workspace
        outer = QVBoxLayout(self)
        outer.setContentsMargins(12, 12, 12, 12)
        outer.setSpacing(10)
        outer.addLayout(self._file_row())
        self.meaning = label("", "hint", wrap=True)
        outer.addWidget(self.meaning)
        across = Columns()
        left = QVBoxLayout()
        left.setSpacing(10)
        runs = self._list()
        left.addWidget(runs, 3)
        self.preview = PlanPreview(workspace, self)
        left.addWidget(self.preview.words)
        self.precision = PrecisionPreview(workspace)
        if wide(100) > LARGE_TEXT:  # one below the other, and the column scrolls
            self.table.setFixedHeight(wide(_TABLE_PX))
            for plot in (self.preview.plot, self.precision.plot):
                plot.setFixedHeight(wide(_PLOT_PX))
                plot.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
            for widget in (self.preview.plot, self.precision, self.precision.words):
                left.addWidget(widget)
            left.setStretchFactor(runs, 0)
            left.addStretch(1)
            across.add_column(Scrolled(left), 3)
        else:
            plots = QHBoxLayout()
            plots.setSpacing(10)
            plots.addWidget(self.preview.plot, 1)
            plots.addWidget(self.precision, 1)
            left.addLayout(plots, 3)
            left.addWidget(self.precision.words)
            column = QWidget()
            left.setContentsMargins(0, 0, 0, 0)
            column.setLayout(left)
            across.add_column(column, 3)
        right = QVBoxLayout()
        right.setSpacing(10)
        self.editor = PlanEditor()
        self.editor.changed.connect(self._plan_edited)
        self.form = ProtocolForm(workspace)
        right.addWidget(self.editor)
        right.addWidget(self.form)
        right.addStretch(1)
        across.add_column(Scrolled(right), 2)
        outer.addLayout(across, 1)
        workspace.protocol_changed.connect(self.refresh)
        self.refresh()

    def _file_row(self) -> QHBoxLayout:
        row = QHBoxLayout()
        row.setSpacing(8)
        # A menu, not a box: the arrow keys of a closed box would load every preset they pass.
        self.preset = button(self.tr("Preset…"))
        self.preset.setMenu(PresetMenu(self.preset, lambda: self._space.settings.panel, self._preset_chosen))
        row.addWidget(self.preset)
        self.file_buttons: dict[str, QPushButton] = {}
        for text, action in (
            (self.tr("Load…"), self._load),
            (self.tr("Save…"), self._save),
            (self.tr("Undo"), self._space.undo.undo),
            (self.tr("Redo"), self._space.undo.redo),
        ):
            made = button(text)
            made.clicked.connect(action)
            row.addWidget(made)
            self.file_buttons[text] = made
        stack = self._space.undo
        for made, able, changed in (
            (self.file_buttons[self.tr("Undo")], stack.canUndo, stack.canUndoChanged),
            (self.file_buttons[self.tr("Redo")], stack.canRedo, stack.canRedoChanged),
        ):
            made.setEnabled(able())
            changed.connect(made.setEnabled)
        row.addStretch(1)
        return row

    def _list(self) -> Panel:
        panel = Panel(self.tr("Runs"))
        add = button(self.tr("Add"))
        menu = LetterMenu(add)
        for kind in KINDS:
            menu.addAction(words.target_name(kind)).triggered.connect(lambda checked=False, kind=kind: self._add(kind))
        add.setMenu(menu)
        buttons = Flow()
        buttons.add_rest()
        panel.top.addLayout(buttons)
        buttons.addWidget(add)
        for text, action in (
            (self.tr("Copy"), self._copy),
            (self.tr("Remove"), self._remove),
            ("↑", lambda: self._move(-1)),
            ("↓", lambda: self._move(1)),
        ):
            made = button(text)
            made.clicked.connect(action)
            if text in "↑↓":
                made.setAccessibleName(self.tr("Move up") if text == "↑" else self.tr("Move down"))
                made.setFixedWidth(wide(48))
            buttons.addWidget(made)
            if action == self._remove:
                self.remove = made
        titles = [self.tr("target"), self.tr("speeds (mm/s)"), self.tr("each (s)"), self.tr("repeats"), ""]
        self.table = table(titles, stretch=1)
        self.table.setAccessibleName(self.tr("Runs"))
        self.table.itemSelectionChanged.connect(self._selected)
        self.table.setMinimumHeight(_TABLE_PX)
        self.table.horizontalHeader().setMinimumSectionSize(wide(60))  # some speeds, with large text too
        panel.body.addWidget(self.table)
        return panel

    # --- showing --------------------------------------------------------------------------------------------

    @property
    def row(self) -> int:
        """The selected row, or −1."""
        rows = self.table.selectionModel().selectedRows()
        return rows[0].row() if rows else -1

    def refresh(self) -> None:
        """Show the protocol."""
        protocol, row = self._space.protocol, self.row
        self.table.blockSignals(True)
        self.table.setRowCount(0)
        for k, plan in enumerate(protocol.runs):
            self.table.insertRow(k)
            speeds = ", ".join(f"{speed:g}" for speed in plan.all_speeds_mm_s if speed is not None)
            for column, text in enumerate(
                (
                    words.target_name(plan.kind),
                    speeds or self.tr("varies"),
                    f"{plan.duration_s:g}" if plan.duration_s else self.tr("default"),
                    str(plan.repeats),
                    self.tr("practice") if plan.practice else "",
                )
            ):
                item = QTableWidgetItem(text)
                item.setToolTip(plain(text))
                self.table.setItem(k, column, item)
        # An empty column would take room from the speeds.
        self.table.setColumnHidden(self.table.columnCount() - 1, not any(plan.practice for plan in protocol.runs))
        self.table.blockSignals(False)
        if protocol.runs:
            self.table.selectRow(min(max(row, 0), len(protocol.runs) - 1))
        self._selected()
        self.meaning.setText(words.preset_meaning(protocol.description))
        self.meaning.setVisible(bool(protocol.description))
        self.form.refresh()
        self.preview.refresh()

    def _selected(self) -> None:
        row = self.row
        self.editor.show_plan(self._space.protocol.runs[row] if 0 <= row < len(self._space.protocol.runs) else None)

    # --- editing --------------------------------------------------------------------------------------------

    def _set_runs(self, runs: tuple[RunPlan, ...], what: str) -> None:
        present = self._space.protocol
        try:
            protocol = Protocol.model_validate({**present.model_dump(), "runs": [plan.model_dump() for plan in runs]})
        except ValueError:
            self._space.noticed.emit("warning", self.tr("A protocol needs at least one run, taps or a clock check."))
            return
        self._space.change_protocol(protocol, what)

    def _add(self, kind: str) -> None:
        speed = {"speeds_mm_s": (100.0, 300.0)} if kind == "circle" else {}
        plan = RunPlan.model_validate({"kind": kind, **speed})
        runs, row = list(self._space.protocol.runs), self.row
        runs.insert(row + 1, plan)
        self._set_runs(tuple(runs), self.tr("add runs"))
        self.table.selectRow(row + 1)

    def _copy(self) -> None:
        runs, row = list(self._space.protocol.runs), self.row
        if row >= 0:
            runs.insert(row + 1, runs[row])
            self._set_runs(tuple(runs), self.tr("copy runs"))
            self.table.selectRow(row + 1)

    def _remove(self) -> None:
        runs, row = list(self._space.protocol.runs), self.row
        if row >= 0:
            del runs[row]
            self._set_runs(tuple(runs), self.tr("remove runs"))

    def _move(self, step: int) -> None:
        runs, row = list(self._space.protocol.runs), self.row
        if row >= 0 and 0 <= row + step < len(runs):
            runs[row], runs[row + step] = runs[row + step], runs[row]
            self._set_runs(tuple(runs), self.tr("move runs"))
            self.table.selectRow(row + step)

    def _plan_edited(self, plan: RunPlan) -> None:
        runs, row = list(self._space.protocol.runs), self.row
        if 0 <= row < len(runs) and runs[row] != plan:
            runs[row] = plan
            self._set_runs(tuple(runs), self.tr("edit runs"))

    # --- files ----------------------------------------------------------------------------------------------

    def _preset_chosen(self, name: str) -> None:
        self._space.change_protocol(load_protocol(name), self.tr("preset {name}").format(name=name))
        self._space.change_settings(protocol=name)

    def _load(self) -> None:
        folder, kind = self._space.settings.folder, self.tr("Protocols (*.toml)")
        ask_open(self, self.tr("Load protocol"), folder, kind, self._load_from)

    def _load_from(self, path: Path) -> None:
        try:
            self._space.change_protocol(load_protocol(path), self.tr("load a protocol"))
        except DraglagError as error:
            self._space.noticed.emit("error", error.message)
        else:
            self._space.change_settings(protocol=str(path))

    def _save(self) -> None:
        start = Path(self._space.settings.folder) / f"{self._space.protocol.name}.toml"
        ask_save(self, self.tr("Save protocol"), start, self.tr("Protocols (*.toml)"), self._save_to)

    def _save_to(self, path: Path) -> None:
        try:
            with new_file(path, replace=True) as growing:
                growing.write_text(to_toml(self._space.protocol), "utf-8")
        except OSError as error:
            self._space.noticed.emit("error", f"{path}: {error.strerror}")
        else:
            self._space.change_settings(protocol=str(path))
            self._space.noticed.emit("info", self.tr("Saved: {path}").format(path=path))

    def restyle_plots(self) -> None:
        """Draw in the present theme."""
        self.preview.restyle_plots()
        self.precision.restyle_plots()
