"""Gap: where simulation and measurement differ, the cause's name, and how the gap shrinks with it.

The page is there only in versions whose library can close the gap.
"""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable
from typing import Any

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHBoxLayout,
    QHeaderView,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from draglag_app.windows.plots import Plot, tr
from draglag_app.windows.tasks import Progress
from draglag_app.windows.theme import theme
from draglag_app.windows.widgets import button, label, restyle
from draglag_app.windows.workspace import Workspace


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
        outer = QVBoxLayout(self)
        outer.setContentsMargins(12, 12, 12, 12)
        outer.setSpacing(10)
        row = QHBoxLayout()
        row.addWidget(label(self.tr("Gap between simulation and measurement"), "pageTitle"))
        row.addStretch(1)
        self.close_button = button(self.tr("Find and close"), "primary", large=True)
        self.close_button.clicked.connect(self.start)
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
        self.table = QTableWidget(0, len(titles))
        self.table.setHorizontalHeaderLabels(titles)
        self.table.verticalHeader().hide()
        self.table.verticalHeader().setDefaultSectionSize(34)
        self.table.setShowGrid(False)
        self.table.setTabKeyNavigation(False)
        self.table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        header = self.table.horizontalHeader()
        header.setDefaultAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(1, QHeaderView.ResizeMode.Stretch)
        outer.addWidget(self.table, 2)
        workspace.session_changed.connect(self._session_changed)
        self._session_changed()

    def start(self) -> None:
        """Close the gap of the session at hand, in a worker."""
        session, close_gap = self._space.session, gap_workflow()
        if session is None or close_gap is None:
            return
        with_progress = "progress" in inspect.signature(close_gap).parameters
        self.close_button.setEnabled(False)
        self._say("", self.tr("Fitting the model, looking at what is left …"))

        def work(progress: Progress) -> dict[str, Any]:
            report = close_gap(session, progress=progress) if with_progress else close_gap(session)
            found: dict[str, Any] = report.to_dict()
            return found

        self._space.tasks.start(self.tr("Closing the gap"), work, self.show_report, self._failed)

    def _failed(self, text: str) -> None:
        self.close_button.setEnabled(True)
        self._say("bad", text)

    def _session_changed(self) -> None:
        self._report = None
        self.table.setRowCount(0)
        self.plot.clear_all()
        ready = self._space.session is not None
        self.close_button.setEnabled(ready)
        hint = self.tr("Find and close: every edge is compared with what the model predicts.")
        self._say("", hint if ready else self.tr("Measure or open a session first."))

    def show_report(self, report: dict[str, Any]) -> None:
        """Show what was found: the design's JSON of a gap report."""
        self._report = report
        self.close_button.setEnabled(True)
        level, text = {
            "no_gap": ("ok", self.tr("No gap: what is left is noise.")),
            "explained": ("ok", self.tr("Explained: the effects below account for the gap.")),
            "unexplained": (
                "warning",
                self.tr("A gap remains that no known effect explains; it follows {covariate}.").format(
                    covariate=report.get("unexplained_by")
                ),
            ),
        }.get(str(report["verdict"]), ("", str(report["verdict"])))
        self._say(level, text)
        self.table.setRowCount(0)
        for k, step in enumerate(report["steps"]):
            self._add_step(k, step)
        self._draw(report)

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
            self.table.setItem(k, column, item)

    def _draw(self, report: dict[str, Any]) -> None:
        self.plot.clear_all()
        gaps = [report["gap_first_mm"], *(step["gap_after_mm"] for step in report["steps"])]
        x = np.arange(len(gaps), dtype=float)
        y = np.array(gaps, float)
        names = [self.tr("none yet"), *(step["effect"] for step in report["steps"])]
        tips = [f"{name}\n{gap:.3f} mm" for name, gap in zip(names, gaps, strict=True)]
        self.plot.line(self.tr("gap"), x, y, theme().blue, 2)
        self.plot.dots(self.tr("steps"), x, y, theme().orange, "s", 10, words=tips)
        floor = np.full(2, float(report["noise_floor_mm"]))
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
