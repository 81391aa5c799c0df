"""Gap: where simulation and measurement differ."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QComboBox,
    QHBoxLayout,
    QTextBrowser,
    QVBoxLayout,
    QWidget,
)

from draglag.analysis import with_stylus
from draglag.errors import DraglagError
from draglag.gap.by_hand import BY_HAND
from draglag.model.file import LatencyModel, save_model
from draglag_app.in_subprocess import close_gap_of, run_in_subprocess, write_gap_of
from draglag_app.windows.pages.parts.gap_picture import GapPicture
from draglag_app.windows.pages.parts.gap_steps import StepPlot, StepTable, remarks, unseen
from draglag_app.windows.parts.ask_files import ask_save
from draglag_app.windows.parts.flow import Flow
from draglag_app.windows.parts.plain import plain
from draglag_app.windows.parts.tasks import Progress, Task
from draglag_app.windows.parts.widgets import Panel, Resting, Shallow, button, label, restyle
from draglag_app.windows.wording.effect_words import effect_meaning, effect_name
from draglag_app.windows.wording.gap_words import headline, law_words
from draglag_app.windows.wording.library_words import in_words
from draglag_app.windows.workspace import Edit, Workspace

# Remarks may be many: beyond some lines they scroll rather than take the pictures' room.
_REMARKS_PX = 84
# A verdict on three effects in the longest words has four lines of large letters.
_VERDICT_PX = 96
State = tuple[frozenset[str], tuple[str, ...]]
"""Effects left out, and effects added by hand."""


class GapPage(QWidget):
    """Finds, adds and removes effects."""

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._space = workspace
        self._report: dict[str, Any] | None = None
        self._without: frozenset[str] = frozenset()
        self._added: tuple[str, ...] = ()
        self._shown: State = (frozenset(), ())
        self._known: dict[State, dict[str, Any]] = {}
        self._runs_chosen: tuple[Any, ...] = ()
        self._stylus_mm: float | None = None  # of the gap that is shown
        self._task: Task | None = None
        outer = QVBoxLayout(self)
        outer.setContentsMargins(12, 12, 12, 12)
        outer.setSpacing(10)
        row = Flow()
        self.explain_button = button(self.tr("Explain the gap"), "primary", large=True)
        self.explain_button.clicked.connect(self.start)
        self.remove_button = button(self.tr("Remove effect"))
        self.remove_button.clicked.connect(self._remove)
        self.choice = self._effects_to_add()
        self.choice.currentIndexChanged.connect(lambda index: self._choice_made())
        self._choice_made()
        self.add_button = button(self.tr("Add effect"))
        self.add_button.clicked.connect(self._add)
        self.save_button = button(self.tr("Save model…"))
        self.save_button.clicked.connect(self._save)
        self._resting = Resting(self.explain_button, self.remove_button, self.add_button, self.save_button)
        for widget in (self.explain_button, self.choice, self.add_button, self.remove_button):
            row.addWidget(widget)
        row.add_rest()
        row.addWidget(self.save_button)
        self.verdict, self.law = label("", "headline", wrap=True), label("", wrap=True)
        # As high as their texts: the hint of a label that wraps knows no width, and would not fit small screens.
        self._verdict_box, self._law_box = Shallow(self.verdict, _VERDICT_PX), Shallow(self.law, _VERDICT_PX)
        outer.addWidget(self._verdict_box)
        outer.addLayout(row)
        outer.addWidget(self._law_box)
        self.plot = StepPlot()
        self.table = StepTable()
        found = QHBoxLayout()
        found.addWidget(self.plot, 2)
        found.addWidget(self.table, 3)
        outer.addLayout(found, 4)
        self.picture = GapPicture()
        self.unseen = self._unseen()
        below = QHBoxLayout()
        below.addWidget(self.picture, 3)
        below.addWidget(self.unseen, 2)
        outer.addLayout(below, 5)
        self.table.itemSelectionChanged.connect(self._row_chosen)
        self.more = label("", "hint", wrap=True)
        self.more.setAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop)
        self.remarks = Shallow(self.more, _REMARKS_PX)
        self.remarks.setAccessibleName(self.tr("Remarks"))
        outer.addWidget(self.remarks)
        workspace.tasks.changed.connect(self._tasks_changed)
        workspace.session_changed.connect(self._session_changed)
        self._session_changed()

    def _effects_to_add(self) -> QComboBox:
        choice = QComboBox()
        choice.setAccessibleName(self.tr("Effect to add"))
        for effect in BY_HAND:
            choice.addItem(effect_name(effect), effect)
            choice.setItemData(choice.count() - 1, effect_meaning(effect), Qt.ItemDataRole.ToolTipRole)
        return choice

    def _unseen(self) -> Panel:
        panel = Panel(self.tr("What this session could not show"))
        self.unseen_text = QTextBrowser()
        self.unseen_text.setAccessibleName(self.tr("What this session could not show"))
        panel.body.addWidget(self.unseen_text)
        panel.hide()
        return panel

    def start(self) -> None:
        """Close the gap in another process, cancellable."""
        session, without, added = self._space.session, self._without, self._added
        corrected, options = self._space.corrected, self._space.options
        if corrected is None or self._task is not None:
            return
        chosen = options.exclude, options.include, options.stylus_mm
        if chosen != self._runs_chosen:
            self._runs_chosen, self._known = chosen, {}
            self._stylus_mm = options.stylus_mm
        known = self._known.get((without, added))
        if known is not None:
            self.show_report(known)
            self._ready()
            return
        self._busy()
        kept, path = self._start_from(), self._space.path
        runs = tuple(run for run in corrected.runs if run.id not in options.exclude)
        judged = replace(corrected, runs=runs)
        self._say("", self.tr("Fitting the model, looking at what is left …"))

        def work(progress: Progress) -> dict[str, Any]:
            found: dict[str, Any] = run_in_subprocess(
                close_gap_of, (judged, without, added, kept, path, options.include), progress
            )
            return found

        def done(report: dict[str, Any]) -> None:
            if report.get("report") is not None and session is self._space.session:
                self._known[without, added] = report
            self.show_report(report)

        self._task = self._space.tasks.start(self.tr("Explaining the gap"), work, done, self._failed)

    def _start_from(self) -> Any:
        for n in range(len(self._added) - 1, -1, -1):
            known = self._known.get((self._without, self._added[:n]))
            if known is not None:
                return known["report"]
        return None

    def _busy(self) -> None:
        self._resting.rest()

    def _ready(self) -> None:
        ready = self._space.session is not None
        self.explain_button.setEnabled(ready)
        self.add_button.setEnabled(ready and self._report is not None and self._report.get("report") is not None)
        self.save_button.setEnabled(bool(self._report and self._report.get("model")))
        self._row_chosen()
        self._resting.give_focus_back()

    def _choice_made(self) -> None:
        effect, tip = str(self.choice.currentData()), self.tr("Effect to add")
        self.choice.setToolTip(plain(f"{tip}: {effect_meaning(effect)}"))
        if self.choice.hasFocus():
            self._explain(effect)

    def _explain(self, effect: str) -> None:
        known = self._report
        lines = remarks(known, self._added, self._without) if known is not None and "steps" in known else []
        first = [f"{effect_name(effect)}: {effect_meaning(effect)}"] if effect else []
        self.remarks.show_text("\n".join(first + lines))

    def _add(self) -> None:
        effect = str(self.choice.currentData())
        there = {step["effect"] for step in self._report["steps"]} if self._report else set()
        if effect in there:
            self._say("warning", self.tr("{effect} is in the model already.").format(effect=effect_name(effect)))
            return
        what = self.tr("add effect {effect}").format(effect=effect_name(effect))
        self._change((self._without - {effect}, (*self._added, effect)), what)

    def _change(self, after: State, what: str) -> None:
        before = (self._without, self._added)
        if after != before:
            self._space.undo.push(Edit(what, lambda: self._with_effects(after), lambda: self._with_effects(before)))

    def _save(self) -> None:
        model = self._report.get("model") if self._report else None
        if not model:
            return

        def write(path: Path) -> None:
            try:
                save_model(LatencyModel.model_validate(model), path)
                self._space.noticed.emit("info", self.tr("Saved: {path}").format(path=path))
            except DraglagError as error:
                self._space.noticed.emit("warning", error.message)

        start = Path(self._space.settings.folder) / "model.json"
        ask_save(self, self.tr("Save model"), start, self.tr("Models (*.json)"), write)

    def write_report(self) -> None:
        """Write the page with figures."""
        session, found = self._space.session, self._report.get("report") if self._report else None
        if session is None or found is None:
            self._space.noticed.emit("info", self.tr("Explain the gap first: there is nothing to report yet."))
            return

        judged = with_stylus(session, self._stylus_mm)

        def begin(path: Path) -> None:
            self._space.tasks.start(
                self.tr("Writing the report"),
                lambda progress: run_in_subprocess(write_gap_of, (judged, found, path), progress),
                lambda result: self._space.saved.emit(path),
                self._space.fault,
            )

        stem = self._space.path.stem if self._space.path is not None else "session"
        start = Path(self._space.settings.folder) / f"{stem}-gap.html"
        ask_save(self, self.tr("Write gap report"), start, "*.html", begin)

    def _tasks_changed(self) -> None:
        if self._task is not None and self._task not in self._space.tasks.running:
            if self._task.cancelled:
                self._say("", self.tr("Cancelled."))
                self._without, self._added = self._shown
            self._task = None
            self._ready()

    def _row_chosen(self) -> None:
        row, effect = self.table.chosen()
        if effect:
            self._explain(effect)
        if self._task is None:
            self.remove_button.setEnabled(bool(self._without or row >= 0))
        self.picture.choose_step(row)
        all_again = row < 0 and bool(self._without)
        self.remove_button.setText(self.tr("All effects") if all_again else self.tr("Remove effect"))

    def _remove(self) -> None:
        row, effect = self.table.chosen()
        if row < 0:
            names = ", ".join(sorted(map(effect_name, self._without)))
            self._change((frozenset(), self._added), self.tr("allow again {effects}").format(effects=names))
            return
        what = self.tr("remove effect {effect}").format(effect=effect_name(effect))
        if effect in self._added:
            self._change((self._without, tuple(e for e in self._added if e != effect)), what)
        else:
            self._change((self._without | {effect}, self._added), what)

    def _with_effects(self, state: State) -> None:
        self._without, self._added = state
        if self._task is not None:  # it computes what is not asked for any more
            self._task.cancel()
            self._task = None
        self.start()

    def _failed(self, text: str) -> None:
        self._without, self._added = self._shown
        self._say("bad", text)

    def _session_changed(self) -> None:
        self._report, self._without, self._added, self._known = None, frozenset(), (), {}
        self._shown = (frozenset(), ())
        self.picture.show_overlay(None)
        self.remarks.show_text("")
        self.remove_button.setEnabled(False)
        self.table.setRowCount(0)
        self.table.hide()
        self.unseen.hide()
        self.plot.clear_all()
        ready = self._space.session is not None
        self._ready()
        hint = self.tr("Explain the gap: every edge is compared with what the model predicts.")
        self._say("", hint if ready else self.tr("Measure or open a session first."))

    def show_report(self, report: dict[str, Any]) -> None:
        """Show a gap report's JSON."""
        self._report, self._shown = report, (self._without, self._added)
        level = {"no_gap": "ok", "explained": "ok"}.get(str(report["verdict"]), "warning")
        text = headline(report) if report["verdict"] else "; ".join(map(in_words, report.get("missing", ())))
        self._say(level, text)
        self._say_law(law_words(report))
        self.table.show_report(report)
        self.table.setVisible(bool(report["steps"]))
        self._explain("")
        self.plot.show_report(report)
        missed = unseen(report)
        self.unseen_text.setPlainText("\n".join(f"• {line}" for line in missed))
        self.unseen.setVisible(bool(missed))
        self.picture.show_overlay(report.get("overlay"), str(report.get("overlay_why") or ""))
        self._ready()

    def _say(self, level: str, text: str) -> None:
        restyle(self.verdict, "level", level)
        self._verdict_box.show_text(text)
        self._say_law("")

    def _say_law(self, text: str) -> None:
        self._law_box.show_text(text)
        self._law_box.setVisible(bool(text))

    def restyle_plots(self) -> None:
        """Draw in the present theme."""
        self.plot.restyle()
        self.picture.restyle()
        if self._report is not None:
            self.plot.show_report(self._report)
