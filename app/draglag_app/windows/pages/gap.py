"""Gap: where simulation and measurement differ, the cause's name, and how the gap shrinks with it.

The page is there only in versions whose library can close the gap.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QHBoxLayout,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from draglag_app.apart import close_gap_of, run_apart
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


class GapPage(QWidget):
    """Find, name, add, shrink: one row a step."""

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._space = workspace
        self._report: dict[str, Any] | None = None
        self._without: frozenset[str] = frozenset()
        self._task: Task | None = None
        outer = QVBoxLayout(self)
        outer.setContentsMargins(12, 12, 12, 12)
        outer.setSpacing(10)
        row = QHBoxLayout()
        row.addWidget(label(self.tr("Gap between simulation and measurement"), "pageTitle"))
        row.addStretch(1)
        self.close_button = button(self.tr("Find and close"), "primary", large=True)
        self.close_button.clicked.connect(self.start)
        self.leave_out = button(self.tr("Take it out again"), large=True)
        self.leave_out.clicked.connect(self._leave_out)
        row.addWidget(self.leave_out)
        row.addWidget(self.close_button)
        outer.addLayout(row)
        self.verdict = label("", "verdict", wrap=True)
        outer.addWidget(self.verdict)
        self.plot = Plot(
            self.tr("Residual on runs held out of the fit"), tr("effects in the model"), tr("gap (mm RMS)"), "gap"
        )
        self.plot.add_legend()
        outer.addWidget(self.plot, 3)
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
        session, without = self._space.session, self._without
        if session is None or self._task is not None:
            return
        self.close_button.setEnabled(False)
        self.leave_out.setEnabled(False)
        self._say("", self.tr("Fitting the model, looking at what is left …"))

        def work(progress: Progress) -> dict[str, Any]:
            found: dict[str, Any] = run_apart(close_gap_of, (session, without), progress)
            return found

        self._task = self._space.tasks.start(self.tr("Closing the gap"), work, self.show_report, self._failed)

    def _tasks_changed(self) -> None:
        """A cancelled task reports nothing: the buttons come back here."""
        if self._task is not None and self._task not in self._space.tasks.running:
            if self._task.cancelled:
                self._say("", self.tr("Cancelled."))
            self._task = None
            self.close_button.setEnabled(self._space.session is not None)
            self._row_chosen()

    def _row_chosen(self) -> None:
        self.leave_out.setEnabled(bool(self._without or self.table.selectionModel().selectedRows()))
        chosen = bool(self.table.selectionModel().selectedRows())
        self.leave_out.setText(self.tr("Take it out again") if chosen or not self._without else self.tr("All effects"))

    def _leave_out(self) -> None:
        """Take the chosen effect out of the model and look again; without a choice, allow all again. Can be undone."""
        rows, before = self.table.selectionModel().selectedRows(), self._without
        item = self.table.item(rows[0].row(), 0) if rows else None
        after = before | {str(item.data(Qt.ItemDataRole.UserRole))} if item is not None else frozenset[str]()
        if after != before:
            self._space.undo.push(
                Edit(self.tr("gap step"), lambda: self._with_effects(after), lambda: self._with_effects(before))
            )

    def _with_effects(self, without: frozenset[str]) -> None:
        self._without = without
        self.start()

    def _failed(self, text: str) -> None:
        self._say("bad", text)

    def _session_changed(self) -> None:
        self._report, self._without = None, frozenset()
        self.more.setText("")
        self.leave_out.setEnabled(False)
        self.table.setRowCount(0)
        self.plot.clear_all()
        ready = self._space.session is not None
        self.close_button.setEnabled(ready)
        hint = self.tr("Find and close: every edge is compared with what the model predicts.")
        self._say("", hint if ready else self.tr("Measure or open a session first."))

    def show_report(self, report: dict[str, Any]) -> None:
        """Show what was found: the design's JSON of a gap report."""
        self._report = report
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

    def _remarks(self, report: dict[str, Any]) -> list[str]:
        lines = [f"{step['effect']}: {step['extra_run']}" for step in report["steps"] if step.get("extra_run")]
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
        self.plot.setYRange(0, 1.1 * max(gaps))

    def _say(self, level: str, text: str) -> None:
        self.verdict.setText(text)
        restyle(self.verdict, "level", level)

    def restyle_plots(self) -> None:
        """Draw in the present theme."""
        self.plot.restyle()
        if self._report is not None:
            self._draw(self._report)


def _value(value: Any) -> str:
    """A parameter with its 95 % interval."""
    if not isinstance(value, dict):
        return str(value)
    interval = value.get("ci95")
    text = f"{value['value']:.4g}"
    return text + (f" ({interval[0]:.4g} … {interval[1]:.4g})" if interval else "")
