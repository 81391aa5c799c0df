"""The steps of a gap report."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from textwrap import fill
from typing import Any

import numpy as np
from PySide6.QtCore import QCoreApplication, Qt
from PySide6.QtGui import QFontMetricsF, QResizeEvent
from PySide6.QtWidgets import QTableWidget, QTableWidgetItem, QWidget

from draglag.gap.constants import PROBABLE
from draglag.gap.results import stated
from draglag.gap.wording import needs_evidence, separating_run
from draglag_app.windows.parts.plain import plain
from draglag_app.windows.parts.theme import theme, wide
from draglag_app.windows.parts.widgets import set_up_table
from draglag_app.windows.plots.plot import Plot, tr
from draglag_app.windows.wording.effect_words import effect_meaning, effect_name, size_words
from draglag_app.windows.wording.gap_words import (
    also_words,
    check_words,
    compared_words,
    followed,
    names_words,
    noise_words,
    tolerated_words,
)
from draglag_app.windows.wording.library_words import in_words
from draglag_app.windows.wording.words import between, flag_name

EFFECT, PROBABILITY = 0, 1
"""Columns of the table."""


def say(text: str) -> str:
    return QCoreApplication.translate("GapPage", text)


class StepTable(QTableWidget):
    """A row per step."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        titles = [say("effect"), say("probability"), say("where"), say("size"), say("gap before → after")]
        set_up_table(self, titles, stretch=len(titles) - 1)  # next to the waterfall: what does not fit is scrolled to
        self.setAccessibleName(say("Effects"))

    def show_report(self, report: dict[str, Any]) -> None:
        self.setRowCount(0)
        compared = compared_words(report)
        for k, step in enumerate(report["steps"]):
            self._add(k, step, compared)

    def chosen(self) -> tuple[int, str]:
        """Row and effect; −1 and "" if none."""
        rows = self.selectionModel().selectedRows()
        item = self.item(rows[0].row(), 0) if rows else None
        return (-1, "") if item is None else (item.row(), str(item.data(Qt.ItemDataRole.UserRole)))

    def _add(self, k: int, step: dict[str, Any], compared: str) -> None:
        self.insertRow(k)
        size = ", ".join(
            size_words(step["effect"], key, value["value"], value.get("ci95"))
            for key, value in step["parameters"].items()
        )
        gap = f"{step['gap_before_mm']:.3f} → {step['gap_after_mm']:.3f} mm"
        texts = (names_words(step), stated(step["probability"]), in_words(step.get("where") or ""), size, gap)
        tips = {EFFECT: effect_meaning(step["effect"]), PROBABILITY: compared}
        for column, text in enumerate(texts):
            item = QTableWidgetItem(text)
            item.setToolTip(plain(tips.get(column) or text))
            item.setData(Qt.ItemDataRole.UserRole, step["effect"])
            self.setItem(k, column, item)


# Of a step's name in a line below the plot: at least and at most.
_LETTERS = (9, 16)
# Width that a bar needs for its name, of how many bars at most, and of the axis; the table next to them scrolls.
_BAR_PX, _MOST_BARS, _AXIS_PX = 80, 6, 56
# Above, between and below the names and the axis' title.
_AROUND_PX = 14
# Of the plot's height; names of two lines take half of it.
_LEAST_PX = 210
_WIDE = 0.62  # of a bar, in places


@dataclass(frozen=True)
class Bar:
    """A bar between the gap before a step and the gap after it, either of which may be the larger one."""

    name: str
    kind: str  # "first", "step", "provisional" or "floor"
    low_mm: float
    high_mm: float
    left_mm: float


def _step_bar(name: str, kind: str, step: dict[str, Any]) -> Bar:
    before_mm, after_mm = step["gap_before_mm"], step["gap_after_mm"]
    return Bar(name, kind, min(before_mm, after_mm), max(before_mm, after_mm), after_mm)


def _whole_bar(name: str, kind: str, mm: float) -> Bar:
    return Bar(name, kind, 0.0, mm, mm)


def waterfall(report: dict[str, Any]) -> list[Bar]:
    """Bars of first gap, steps, noise floor.

    Provisional: an unnamed term, and effects less probable than not.
    """
    bars = [_whole_bar(say("none yet"), "first", report["gap_first_mm"])]
    for step in report["steps"]:
        name, sure = effect_name(step["effect"]), step["probability"] >= PROBABLE
        bars.append(_step_bar(name if sure else f"~ {name}", "step" if sure else "provisional", step))
    unnamed = report.get("provisional")
    if unnamed is not None:
        name = "~ " + say("without a name: {what}").format(what=followed(unnamed["covariate"]))
        bars.append(_step_bar(name, "provisional", unnamed))
    return [*bars, _whole_bar(say("noise floor"), "floor", float(report["noise_floor_mm"] or 0.0))]


class StepPlot(Plot):
    """The gap as a waterfall."""

    def __init__(self, parent: QWidget | None = None) -> None:
        title = say("Residual on runs held out of the fit")
        super().__init__(title, tr("effects in the model"), tr("gap (mm RMS)"), "gap", parent)
        self.setMinimumHeight(_LEAST_PX)
        self._narrowest_px = self.minimumWidth()
        self._bars: list[Bar] = []

    def show_report(self, report: dict[str, Any]) -> None:
        self.clear_all()
        if report["gap_first_mm"] is None:
            return
        bars = waterfall(report)
        colours = {
            "first": theme().orange, "step": theme().blue, "provisional": theme().purple, "floor": theme().green,
        }  # fmt: skip
        names = {"first": say("first gap"), "step": say("steps"), "provisional": say("provisional"),
                 "floor": say("noise floor")}  # fmt: skip
        for kind, colour in colours.items():
            chosen = [k for k, bar in enumerate(bars) if bar.kind == kind]
            if chosen:
                low = np.array([bars[k].low_mm for k in chosen])
                high = np.array([bars[k].high_mm for k in chosen])
                tips = [
                    f"{bars[k].name}\n{between(f'{bars[k].low_mm:.3f}', f'{bars[k].high_mm:.3f}')} mm" for k in chosen
                ]
                self.bars(
                    names[kind], np.array(chosen, float), high - low, _WIDE, colour, low, kind == "provisional", tips
                )
        gaps = [report["gap_first_mm"], *(step["gap_after_mm"] for step in report["steps"])]
        # Where one bar ends the next begins: the line through the gaps shows that, and holds their numbers.
        self.line(say("gap"), np.arange(len(gaps), dtype=float), np.array(gaps, float), theme().muted, 1, dash=True)
        self._bars = bars
        self.setMinimumWidth(wide(_BAR_PX * min(len(bars), _MOST_BARS) + _AXIS_PX))
        self._name_below()
        self.setXRange(-0.5, len(bars) - 0.5, padding=0)
        self.setYRange(0, 1.1 * max(bar.high_mm for bar in bars))

    def clear_all(self) -> None:
        """Remove everything."""
        self._bars = []
        self.setMinimumWidth(self._narrowest_px)
        super().clear_all()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        if getattr(self, "_bars", None):
            self._name_below()

    def _name_below(self) -> None:
        axis, bars = self.getAxis("bottom"), self._bars
        # A name that is wider than its place would be left out, or run into the next.
        place_px = (self.width() - self.getAxis("left").width()) / len(bars)
        letter_px = QFontMetricsF(axis.style["tickFont"] or self.font()).averageCharWidth()
        letters = int(min(max(place_px / letter_px, _LETTERS[0]), _LETTERS[1]))
        below = [fill(bar.name, letters) + f"\n{bar.left_mm:.2f} mm" for bar in bars]
        axis.setTicks([list(enumerate(below))])
        # Of itself the axis makes room for one line and its title.
        lines = max(text.count("\n") for text in below) + 1
        axis.setHeight((lines + 1) * self.fontMetrics().height() + _AROUND_PX)


def unseen(report: dict[str, Any]) -> list[str]:
    """Effects the session could not show."""
    return [f"{effect_name(effect)}: {in_words(why)}" for effect, why in report.get("not_seen", {}).items()]


def remarks(report: dict[str, Any], added: Collection[str], without: Collection[str]) -> list[str]:
    """Lines on other explanations, effects by hand, runs left out."""
    steps = report["steps"]
    lines = [also_words(report)]
    for step in steps:
        alike = step.get("indistinguishable_from") or ()
        run = separating_run(step["effect"], alike, step.get("extra_run", "")) if alike else ""
        lines.append(f"{names_words(step)}: {in_words(run)}" if run else "")
        gaps = step.get("gap_before_mm", 0.0), step.get("gap_after_mm", 0.0)
        if step["effect"] in added or needs_evidence(step.get("covariate"), *gaps):
            lines.append(f"{effect_name(step['effect'])}: {in_words(step['evidence'].get('text', ''))}")
    lines.append(in_words(report.get("drift_in_analysis") or ""))
    gone, part = (_with_flags(report.get(key, {})) for key in ("excluded", "flagged"))
    lines.append(say("Not judged by: {runs}").format(runs=gone) if gone else "")
    lines.append(say("With edges excluded or scattered: {runs}").format(runs=part) if part else "")
    lines += [check_words(report), tolerated_words(report), noise_words(report)]
    if without:
        lines.append(say("Excluded: {effects}").format(effects=", ".join(sorted(map(effect_name, without)))))
    return [line for line in lines if line]


def _with_flags(runs: dict[str, str]) -> str:
    return ", ".join(f"{run} ({', '.join(map(flag_name, flags.split(', ')))})" for run, flags in runs.items())
