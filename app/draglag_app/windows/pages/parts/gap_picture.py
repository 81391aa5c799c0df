"""The Gap page's plot of simulated against measured."""

from __future__ import annotations

from typing import Any

import numpy as np
from PySide6.QtWidgets import QComboBox, QHBoxLayout, QVBoxLayout, QWidget

from draglag_app.windows.parts.full_texts import ElidedBox, whole_text
from draglag_app.windows.parts.theme import theme
from draglag_app.windows.parts.widgets import label
from draglag_app.windows.plots.plot import Plot, tr
from draglag_app.windows.wording.i18n import QT_TRANSLATE_NOOP
from draglag_app.windows.wording.words import between

# What to show: key, words, and the titles of its axes.
KINDS = (
    ("edges", QT_TRANSLATE_NOOP("Plot", "Edges, run by run"), "drag speed (mm/s)", "difference (ms)"),
    ("latencies", QT_TRANSLATE_NOOP("Plot", "Latency of every run"), "drag speed (mm/s)", "latency (ms)"),
    ("speed", QT_TRANSLATE_NOOP("Plot", "Residual against speed"), "drag speed (mm/s)", "residual (ms)"),
    ("session_time", QT_TRANSLATE_NOOP("Plot", "Residual against session time"), "session time (s)", "residual (ms)"),
    ("x", QT_TRANSLATE_NOOP("Plot", "Residual against x"), "x (mm)", "residual (ms)"),
    ("time_in_run", QT_TRANSLATE_NOOP("Plot", "Residual against time in the run"), "time in run (s)", "residual (ms)"),
    (
        "acceleration",
        QT_TRANSLATE_NOOP("Plot", "Residual against acceleration"),
        "acceleration (mm/s²)",
        "residual (ms)",
    ),
    (
        "normal_acceleration",
        QT_TRANSLATE_NOOP("Plot", "Residual against normal acceleration"),
        "normal acceleration (mm/s²)",
        "residual (ms)",
    ),
    ("spread", QT_TRANSLATE_NOOP("Plot", "Distribution of residuals"), "residual (mm)", "edges (%)"),
)
AXES = (
    QT_TRANSLATE_NOOP("Plot", "session time (s)"),
    QT_TRANSLATE_NOOP("Plot", "time in run (s)"),
    QT_TRANSLATE_NOOP("Plot", "acceleration (mm/s²)"),
    QT_TRANSLATE_NOOP("Plot", "normal acceleration (mm/s²)"),
    QT_TRANSLATE_NOOP("Plot", "residual (ms)"),
    QT_TRANSLATE_NOOP("Plot", "residual (mm)"),
    QT_TRANSLATE_NOOP("Plot", "edges (%)"),
)


# Of what is chosen; the rest is in the tooltip, for narrow windows.
_LETTERS = 14


class GapPicture(QWidget):
    """A plot, and the choice of what it shows."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._overlay: dict[str, Any] | None = None
        self._model = -1
        outer = QVBoxLayout(self)
        outer.setContentsMargins(0, 0, 0, 0)
        row = QHBoxLayout()
        self.kind = ElidedBox(_LETTERS)
        self.kind.setAccessibleName(self.tr("What the picture shows"))
        for key, words, _, _ in KINDS:
            self.kind.addItem(tr(words), key)
        whole_text(self.kind)
        self.which = QComboBox()
        self.which.setAccessibleName(self.tr("Before or after"))
        for key, words in (
            ("both", self.tr("before and after")),
            ("before", self.tr("before")),
            ("after", self.tr("after")),
        ):
            self.which.addItem(words, key)
        row.addWidget(self.kind, 2)
        row.addWidget(self.which, 1)
        outer.addLayout(row)
        self.plot = Plot(
            self.tr("Simulated against measured"), tr("drag speed (mm/s)"), tr("latency (ms)"), "gap-overlay"
        )
        self.plot.add_legend(columns=3)
        outer.addWidget(self.plot, 1)
        self.words = label("", "hint", wrap=True)
        outer.addWidget(self.words)
        self.kind.currentIndexChanged.connect(self.draw)
        self.which.currentIndexChanged.connect(self.draw)

    def show_overlay(self, overlay: dict[str, Any] | None, why: str = "") -> None:
        """Draw the library's ``overlay_numbers``, or say ``why`` not."""
        self._overlay, self._model = overlay, -1
        self.words.setText(why)
        self.draw()

    def choose_step(self, step: int) -> None:
        """Compare a step with the one before; −1: last with first."""
        self._model = step
        self.draw()

    def _compared(self) -> list[tuple[str, dict[str, Any], str, str]]:
        assert self._overlay is not None
        models = self._overlay["models"]
        last = len(models) - 1 if self._model < 0 else min(self._model + 1, len(models) - 1)
        first = 0 if self._model < 0 else max(last - 1, 0)
        chosen = self.which.currentData()
        out = []
        if chosen != "after" or last == first:
            alone = chosen == "both" and last == first  # nothing was added: there is no after
            name = self.tr("simulated") if alone else self.tr("simulated, before")
            out.append((name, models[first], theme().orange, "t1"))
        if chosen != "before" and last != first:
            out.append((self.tr("simulated, after"), models[last], theme().blue, "o"))
        return out

    def draw(self) -> None:
        """Draw the choice in the present theme."""
        self.plot.clear_all()
        if self._overlay is None:
            return
        key, _, x, y = KINDS[max(self.kind.currentIndex(), 0)]
        self.plot.relabel(self.tr("Simulated against measured"), tr(x), tr(y))
        compared = self._compared()
        draw = {"edges": self._edges, "latencies": self._latencies, "spread": self._spread}.get(key)
        if draw is not None:
            draw(compared)
        else:
            self._residuals(key, compared)
        self._make_room()
        lines = []
        for name, model, _, _ in compared:
            low, high = model["edge_rms_ms_ci95"]
            inside, of = model["runs_that_agree"]
            lines.append(
                self.tr(
                    "{name}: edges off by {rms} ms ({low} to {high}); latency agrees in {inside} of {of} runs"
                ).format(
                    name=name,
                    rms=f"{model['edge_rms_ms']:.2f}",
                    low=f"{low:.2f}",
                    high=f"{high:.2f}",
                    inside=inside,
                    of=of,
                )
            )
        self.words.setText("\n".join(lines))

    def _make_room(self) -> None:
        parts = []
        for name, numbers in self.plot.drawn.items():
            reach = numbers[2] if len(numbers) > 2 and not name.endswith("95 %") else 0.0
            parts += [numbers[1] - reach, numbers[1] + reach]
        values = np.concatenate(parts) if parts else np.zeros(1)
        values = values[np.isfinite(values)]
        if values.size:
            low, high = float(values.min()), float(values.max())
            span = max(high - low, 1e-3)
            self.plot.setYRange(low - 0.1 * span, high + 0.45 * span)

    def _edges(self, compared: list[tuple[str, dict[str, Any], str, str]]) -> None:
        for k, (name, model, colour, symbol) in enumerate(compared):
            rows = sorted(model["edges"], key=lambda row: row[1])
            table = np.array([row[1:] for row in rows], float).reshape(-1, 4)
            words = [f"{row[0]}\n{row[2]:+.2f} ms ({between(f'{row[3]:+.2f}', f'{row[4]:+.2f}')})" for row in rows]
            x = table[:, 0] * (1 + 0.01 * k)
            self.plot.dots(name, x, table[:, 1], colour, symbol, error=0.5 * (table[:, 3] - table[:, 2]), words=words)

    def _latencies(self, compared: list[tuple[str, dict[str, Any], str, str]]) -> None:
        rows = [row for _, model, _, _ in compared[:1] for row in model["latencies"]]
        table = np.array([row[1:] for row in rows], float).reshape(-1, 5)
        name = self.tr("measured")
        self.plot.dots(name, table[:, 0], table[:, 1], theme().text, "s", 11, hollow=True, error=1.96 * table[:, 2])
        for name, model, colour, symbol in compared:
            table = np.array([row[1:] for row in model["latencies"]], float).reshape(-1, 5)
            words = [f"{row[0]}\n{row[2]:.2f} / {row[4]:.2f} ms" for row in model["latencies"]]
            self.plot.dots(name, table[:, 0], table[:, 3], colour, symbol, error=1.96 * table[:, 4], words=words)

    def _residuals(self, covariate: str, compared: list[tuple[str, dict[str, Any], str, str]]) -> None:
        assert self._overlay is not None
        middle, mean, reach = (np.array(c, float) for c in self._overlay["measured"]["residuals"][covariate])
        self.plot.dots(self.tr("measured"), middle, mean, theme().text, "s", 9, error=reach)
        for name, model, colour, _ in compared:
            if covariate not in model.get("residuals", {}):
                continue
            middle, mean, reach = (np.array(c, float) for c in model["residuals"][covariate])
            self.plot.band(f"{name} 95 %", middle, mean - reach, mean + reach, colour)
            self.plot.line(name, middle, mean, colour, 2)

    def _spread(self, compared: list[tuple[str, dict[str, Any], str, str]]) -> None:
        assert self._overlay is not None
        rows = [(self.tr("measured"), self._overlay["measured"], theme().text)]
        rows += [(name, model, colour) for name, model, colour, _ in compared if "spread" in model]
        for name, model, colour in rows:
            x, y = (np.array(column, float) for column in model["spread"])
            self.plot.line(name, x, y, colour, 2)

    def restyle(self) -> None:
        """Draw in the present theme."""
        self.plot.restyle()
        self.draw()
