"""Gap: where simulation and measurement differ, the cause's name, and how the gap shrinks with it.

The page is there only in versions whose library can close the gap.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QComboBox,
    QFileDialog,
    QHBoxLayout,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from draglag.errors import DraglagError
from draglag.gap.by_hand import BY_HAND
from draglag.model_file import LatencyModel, save_model
from draglag_app.apart import close_gap_of, run_apart
from draglag_app.windows.gap_picture import GapPicture
from draglag_app.windows.plots import Plot, tr
from draglag_app.windows.tasks import Progress, Task
from draglag_app.windows.theme import theme
from draglag_app.windows.widgets import button, label, restyle, table
from draglag_app.windows.workspace import Edit, Workspace


def gap_workflow() -> Callable[..., Any] | None:
    """``close_gap`` of the library, or None in a version without it."""
    try:
        found = getattr(importlib.import_module("draglag.gap"), "close_gap", None)
    except ImportError:
        return None
    return found if callable(found) else None


State = tuple[frozenset[str], tuple[str, ...]]
"""Effects left out, and effects added by hand."""


class GapPage(QWidget):
    """Find, name, add, shrink: one row a step."""

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._space = workspace
        self._report: dict[str, Any] | None = None
        self._without: frozenset[str] = frozenset()
        self._added: tuple[str, ...] = ()
        self._shown: State = (frozenset(), ())
        self._known: dict[State, dict[str, Any]] = {}
        self._task: Task | None = None
        outer = QVBoxLayout(self)
        outer.setContentsMargins(12, 12, 12, 12)
        outer.setSpacing(10)
        row = QHBoxLayout()
        row.addWidget(label(self.tr("Gap between simulation and measurement"), "pageTitle"))
        row.addStretch(1)
        self.close_button = button(self.tr("Find and close"), "primary", large=True)
        self.close_button.clicked.connect(self.start)
        self.leave_out = button(self.tr("Take it out again"))
        self.leave_out.clicked.connect(self._leave_out)
        self.choice = QComboBox()
        self.choice.setAccessibleName(self.tr("Effect to add by hand"))
        self.choice.addItems(list(BY_HAND))
        self.choice.setToolTip(self.tr("Effect to add by hand"))
        self.add_button = button(self.tr("Add by hand"))
        self.add_button.clicked.connect(self._add)
        self.save_button = button(self.tr("Save model …"))
        self.save_button.clicked.connect(self._save)
        row.addWidget(self.close_button)
        outer.addLayout(row)
        by_hand = QHBoxLayout()
        for widget in (self.choice, self.add_button, self.leave_out):
            by_hand.addWidget(widget)
        by_hand.addStretch(1)
        by_hand.addWidget(self.save_button)
        outer.addLayout(by_hand)
        self.verdict = label("", "verdict", wrap=True)
        outer.addWidget(self.verdict)
        self.plot = Plot(
            self.tr("Residual on runs held out of the fit"), tr("effects in the model"), tr("gap (mm RMS)"), "gap"
        )
        self.plot.add_legend()
        self.picture = GapPicture()
        pictures = QHBoxLayout()
        pictures.addWidget(self.plot, 2)
        pictures.addWidget(self.picture, 3)
        outer.addLayout(pictures, 5)
        titles = [self.tr("effect"), self.tr("where"), self.tr("size"), self.tr("gap before → after"), self.tr("p")]
        self.table = table(titles, stretch=1)
        outer.addWidget(self.table, 2)
        self.table.itemSelectionChanged.connect(self._row_chosen)
        self.more = label("", "hint", wrap=True)
        outer.addWidget(self.more)
        workspace.tasks.changed.connect(self._tasks_changed)
        workspace.session_changed.connect(self._session_changed)
        self._session_changed()

    def start(self) -> None:
        """Close the gap of the session at hand, in a process of its own: it takes a minute, and can be cancelled."""
        session, without, added = self._space.session, self._without, self._added
        if session is None or self._task is not None:
            return
        known = self._known.get((without, added))
        if known is not None:
            self.show_report(known)
            self._ready()
            return
        self._busy()
        kept, path = self._start_from(), self._space.path
        self._say("", self.tr("Fitting the model, looking at what is left …"))

        def work(progress: Progress) -> dict[str, Any]:
            found: dict[str, Any] = run_apart(close_gap_of, (session, without, added, kept, path), progress)
            return found

        def done(report: dict[str, Any]) -> None:
            if report.get("report") is not None and session is self._space.session:
                self._known[without, added] = report
            self.show_report(report)

        self._task = self._space.tasks.start(self.tr("Closing the gap"), work, done, self._failed)

    def _start_from(self) -> Any:
        """A report with fewer effects added by hand, to go on from; None where there is none."""
        for n in range(len(self._added) - 1, -1, -1):
            known = self._known.get((self._without, self._added[:n]))
            if known is not None:
                return known["report"]
        return None

    def _busy(self) -> None:
        for widget in (self.close_button, self.leave_out, self.add_button, self.save_button):
            widget.setEnabled(False)

    def _ready(self) -> None:
        ready = self._space.session is not None
        self.close_button.setEnabled(ready)
        self.add_button.setEnabled(ready and self._report is not None and self._report.get("report") is not None)
        self.save_button.setEnabled(bool(self._report and self._report.get("model")))
        self._row_chosen()

    def _add(self) -> None:
        """Add the chosen effect to the model, of fitted size. Can be undone."""
        effect = self.choice.currentText()
        there = {step["effect"] for step in self._report["steps"]} if self._report else set()
        if effect in there:
            self._say("warning", self.tr("{effect} is in the model already.").format(effect=effect))
            return
        self._change((self._without - {effect}, (*self._added, effect)))

    def _change(self, after: State) -> None:
        before = (self._without, self._added)
        if after != before:
            edit = Edit(self.tr("gap step"), lambda: self._with_effects(after), lambda: self._with_effects(before))
            self._space.undo.push(edit)

    def _save(self) -> None:
        """Write the extended model."""
        model = self._report.get("model") if self._report else None
        if not model:
            return
        name, _ = QFileDialog.getSaveFileName(self, self.tr("Save model"), "model.json", self.tr("Models (*.json)"))
        if name:
            try:
                save_model(LatencyModel.model_validate(model), Path(name))
                self._space.noticed.emit("info", self.tr("Model saved: {name}").format(name=name))
            except DraglagError as error:
                self._space.noticed.emit("warning", str(error))

    def _tasks_changed(self) -> None:
        """A cancelled task reports nothing: the buttons come back here."""
        if self._task is not None and self._task not in self._space.tasks.running:
            if self._task.cancelled:
                self._say("", self.tr("Cancelled."))
                self._without, self._added = self._shown
            self._task = None
            self._ready()

    def _row_chosen(self) -> None:
        rows = self.table.selectionModel().selectedRows()
        if self._task is None:
            self.leave_out.setEnabled(bool(self._without or rows))
        self.picture.choose_step(rows[0].row() if rows else -1)
        chosen = bool(self.table.selectionModel().selectedRows())
        self.leave_out.setText(self.tr("Take it out again") if chosen or not self._without else self.tr("All effects"))

    def _leave_out(self) -> None:
        """Take the chosen effect out of the model and look again; without a choice, allow all again. Can be undone."""
        rows = self.table.selectionModel().selectedRows()
        item = self.table.item(rows[0].row(), 0) if rows else None
        if item is None:
            self._change((frozenset(), self._added))
            return
        effect = str(item.data(Qt.ItemDataRole.UserRole))
        if effect in self._added:
            self._change((self._without, tuple(e for e in self._added if e != effect)))
        else:
            self._change((self._without | {effect}, self._added))

    def _with_effects(self, state: State) -> None:
        self._without, self._added = state
        self.start()

    def _failed(self, text: str) -> None:
        self._without, self._added = self._shown
        self._say("bad", text)

    def _session_changed(self) -> None:
        self._report, self._without, self._added, self._known = None, frozenset(), (), {}
        self._shown = (frozenset(), ())
        self.picture.show_overlay(None)
        self.more.setText("")
        self.leave_out.setEnabled(False)
        self.table.setRowCount(0)
        self.plot.clear_all()
        ready = self._space.session is not None
        self._ready()
        hint = self.tr("Find and close: every edge is compared with what the model predicts.")
        self._say("", hint if ready else self.tr("Measure or open a session first."))

    def show_report(self, report: dict[str, Any]) -> None:
        """Show what was found: the design's JSON of a gap report."""
        self._report, self._shown = report, (self._without, self._added)
        level, text = {
            "no_gap": ("ok", self.tr("No gap: what is left is noise.")),
            "explained": ("ok", self.tr("Explained: the effects below account for the gap.")),
            "unexplained": (
                "warning",
                self.tr("A gap remains that no known effect explains; it follows {covariate}.").format(
                    covariate=report.get("unexplained_by")
                ),
            ),
        }.get(str(report["verdict"]), ("warning", " ".join(report.get("missing", ()))))
        self._say(level, text)
        self.table.setRowCount(0)
        for k, step in enumerate(report["steps"]):
            self._add_step(k, step)
        self.more.setText("\n".join(self._remarks(report)))
        self._draw(report)
        self.picture.show_overlay(report.get("overlay"), str(report.get("overlay_why") or ""))
        self._ready()

    def _remarks(self, report: dict[str, Any]) -> list[str]:
        lines = [f"{step['effect']}: {step['extra_run']}" for step in report["steps"] if step.get("extra_run")]
        for step in report["steps"]:
            if step["effect"] in self._added:
                lines.append(f"{step['effect']}: {step['evidence'].get('text', '')}")
        unseen = [f"{effect}: {why}" for effect, why in report.get("not_seen", {}).items()]
        if unseen:
            lines.append(self.tr("This session cannot show: {effects}").format(effects="; ".join(unseen)))
        if self._without:
            lines.append(self.tr("Left out: {effects}").format(effects=", ".join(sorted(self._without))))
        return lines

    def _add_step(self, k: int, step: dict[str, Any]) -> None:
        self.table.insertRow(k)
        twins = step.get("indistinguishable_from") or []
        name = step["effect"] + (self.tr(" (or {others})").format(others=", ".join(twins)) if twins else "")
        size = ", ".join(f"{key} {_value(value)}" for key, value in step["parameters"].items())
        gap = f"{step['gap_before_mm']:.3f} → {step['gap_after_mm']:.3f} mm"
        chance = f"{step['evidence']['p_value']:.1e}"
        for column, text in enumerate((name, str(step.get("where", "")), size, gap, chance)):
            item = QTableWidgetItem(text)
            item.setToolTip(text)
            item.setData(Qt.ItemDataRole.UserRole, step["effect"])
            self.table.setItem(k, column, item)

    def _draw(self, report: dict[str, Any]) -> None:
        self.plot.clear_all()
        if report["gap_first_mm"] is None:
            return
        gaps = [report["gap_first_mm"], *(step["gap_after_mm"] for step in report["steps"])]
        x = np.arange(len(gaps), dtype=float)
        y = np.array(gaps, float)
        names = [self.tr("none yet"), *(step["effect"] for step in report["steps"])]
        tips = [f"{name}\n{gap:.3f} mm" for name, gap in zip(names, gaps, strict=True)]
        self.plot.line(self.tr("gap"), x, y, theme().blue, 2)
        self.plot.dots(self.tr("steps"), x, y, theme().orange, "s", 10, words=tips)
        floor = np.full(2, float(report["noise_floor_mm"] or 0.0))
        self.plot.line(self.tr("noise floor"), np.array([-0.2, len(gaps) - 0.8]), floor, theme().green, 2, dash=True)
        self.plot.getAxis("bottom").setTicks([[(float(k), name) for k, name in enumerate(names)]])
        self.plot.setYRange(0, 1.4 * max(*gaps, *floor))

    def _say(self, level: str, text: str) -> None:
        self.verdict.setText(text)
        restyle(self.verdict, "level", level)

    def restyle_plots(self) -> None:
        """Draw in the present theme."""
        self.plot.restyle()
        self.picture.restyle()
        if self._report is not None:
            self._draw(self._report)


def _value(value: Any) -> str:
    """A parameter with its 95 % interval."""
    if not isinstance(value, dict):
        return str(value)
    interval = value.get("ci95")
    text = f"{value['value']:.4g}"
    return text + (f" ({interval[0]:.4g} … {interval[1]:.4g})" if interval else "")
