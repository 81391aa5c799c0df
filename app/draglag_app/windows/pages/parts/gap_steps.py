"""The steps of a closed gap as the page shows them: a table of effects, a plot of the gap that shrinks, remarks."""

from __future__ import annotations

from collections.abc import Collection
from textwrap import fill
from typing import Any

import numpy as np
from PySide6.QtCore import QCoreApplication, Qt
from PySide6.QtWidgets import QTableWidget, QTableWidgetItem, QWidget

from draglag.gap.results import BY_TAPS, stated
from draglag.gap.wording import separating_run
from draglag_app.windows.parts.plain import plain
from draglag_app.windows.parts.theme import theme
from draglag_app.windows.parts.widgets import set_up_table
from draglag_app.windows.plots.plot import Plot, tr
from draglag_app.windows.wording.effect_words import effect_meaning, effect_name, size_words
from draglag_app.windows.wording.gap_words import also_words, check_words, compared_words, names_words, tolerated_words
from draglag_app.windows.wording.library_words import in_words
from draglag_app.windows.wording.words import flag_name

EFFECT, PROBABILITY = 0, 1
"""Columns of the table."""


def say(text: str) -> str:
    return QCoreApplication.translate("GapPage", text)


class StepTable(QTableWidget):
    """One row a step of a gap report (the design's JSON)."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        titles = [say("effect"), say("probability"), say("where"), say("size"), say("gap before → after")]
        set_up_table(self, titles, stretch=2)

    def show_report(self, report: dict[str, Any]) -> None:
        self.setRowCount(0)
        compared = compared_words(report)
        for k, step in enumerate(report["steps"]):
            self._add(k, step, compared)

    def chosen(self) -> tuple[int, str]:
        """Row and effect that are chosen; −1 and nothing where none is."""
        rows = self.selectionModel().selectedRows()
        item = self.item(rows[0].row(), 0) if rows else None
        return (-1, "") if item is None else (item.row(), str(item.data(Qt.ItemDataRole.UserRole)))

    def _add(self, k: int, step: dict[str, Any], compared: str) -> None:
        self.insertRow(k)
        size = ", ".join(_size(key, value) for key, value in step["parameters"].items())
        gap = f"{step['gap_before_mm']:.3f} → {step['gap_after_mm']:.3f} mm"
        texts = (names_words(step), stated(step["probability"]), in_words(str(step.get("where", ""))), size, gap)
        tips = {EFFECT: effect_meaning(step["effect"]), PROBABILITY: compared}
        for column, text in enumerate(texts):
            item = QTableWidgetItem(text)
            item.setToolTip(plain(tips.get(column) or text))
            item.setData(Qt.ItemDataRole.UserRole, step["effect"])
            self.setItem(k, column, item)


# Of a step's name in a line below the plot: at least, and of all names together.
_LETTERS, _LETTERS_IN_ALL = 14, 48
# Above, between and below the names and the axis' title.
_AROUND_PX = 14


class StepPlot(Plot):
    """The gap on runs held out of the fit, step by step, against the noise floor."""

    def __init__(self, parent: QWidget | None = None) -> None:
        title = say("Residual on runs held out of the fit")
        super().__init__(title, tr("effects in the model"), tr("gap (mm RMS)"), "gap", parent)
        self.add_legend(columns=3)

    def show_report(self, report: dict[str, Any]) -> None:
        self.clear_all()
        if report["gap_first_mm"] is None:
            return
        gaps = [report["gap_first_mm"], *(step["gap_after_mm"] for step in report["steps"])]
        x, y = np.arange(len(gaps), dtype=float), np.array(gaps, float)
        names = [say("none yet"), *(effect_name(step["effect"]) for step in report["steps"])]
        tips = [f"{name}\n{gap:.3f} mm" for name, gap in zip(names, gaps, strict=True)]
        self.line(say("gap"), x, y, theme().blue, 2)
        self.dots(say("steps"), x, y, theme().orange, "s", 10, words=tips)
        floor = np.full(2, float(report["noise_floor_mm"] or 0.0))
        self.line(say("noise floor"), np.array([-0.2, len(gaps) - 0.8]), floor, theme().green, 2, dash=True)
        # A name that is wider than its place would be left out.
        below = [fill(name, max(_LETTERS, _LETTERS_IN_ALL // len(names))) for name in names]
        axis = self.getAxis("bottom")
        axis.setTicks([list(enumerate(below))])
        # Of itself the axis makes room for one line and its title.
        lines = max(text.count("\n") for text in below) + 1
        axis.setHeight((lines + 1) * self.fontMetrics().height() + _AROUND_PX if lines > 1 else None)
        self.setXRange(-0.5, len(gaps) - 0.5, padding=0)
        # With room for the legend above the highest of them.
        self.setYRange(0, 1.4 * max(*gaps, *floor))


def remarks(report: dict[str, Any], added: Collection[str], without: Collection[str]) -> list[str]:
    """Other explanations, what would separate them, how effects by taps or by hand are judged, what is tolerated and
    what the session cannot show."""
    steps = report["steps"]
    lines = [also_words(report)]
    for step in steps:
        alike = step.get("indistinguishable_from") or ()
        run = separating_run(step["effect"], alike, step.get("extra_run", "")) if alike else ""
        lines.append(f"{names_words(step)}: {in_words(run)}" if run else "")
        if step["effect"] in added or step.get("covariate") == BY_TAPS:  # whose gap is not the one before it
            lines.append(f"{effect_name(step['effect'])}: {in_words(step['evidence'].get('text', ''))}")
    lines.append(in_words(report.get("drift_in_analysis") or ""))
    gone = [f"{run} ({', '.join(map(flag_name, why.split(', ')))})" for run, why in report.get("excluded", {}).items()]
    if gone:
        lines.append(say("Not judged by: {runs}").format(runs=", ".join(gone)))
    lines += [check_words(report), tolerated_words(report)]
    unseen = [f"{effect_name(effect)}: {in_words(why)}" for effect, why in report.get("not_seen", {}).items()]
    if unseen:
        lines.append(say("This session cannot show: {effects}").format(effects="; ".join(unseen)))
    if without:
        lines.append(say("Excluded: {effects}").format(effects=", ".join(sorted(map(effect_name, without)))))
    return [line for line in lines if line]


def _size(parameter: str, value: Any) -> str:
    """A parameter with its 95 % interval."""
    if not isinstance(value, dict):
        return f"{parameter} {value}"
    return size_words(parameter, value["value"], value.get("ci95"))
