"""Plots of the Results page."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape

import numpy as np
from PySide6.QtWidgets import QTableWidgetItem, QVBoxLayout, QWidget

from draglag.instruments.taps import TapSummary
from draglag.latency import RunEstimate, estimate
from draglag.latency.edges import Edges
from draglag.latency.estimate import WINDOW_S, Alignment
from draglag.latency.scan import Scan, scan
from draglag.recording import Run, Session
from draglag.validation.misalignment import Validation
from draglag_app.windows.parts.tasks import Progress, Tasks
from draglag_app.windows.parts.theme import theme
from draglag_app.windows.parts.widgets import Scrolled, table
from draglag_app.windows.plots.plot import Plot, tr
from draglag_app.windows.wording import words

_SCAN_HALF_S = 0.05


class AlignmentPlot(Plot):
    """Positions at the edges, uncorrected and shifted by the latency (the paper's Fig. 4)."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(tr("Edges on the screen"), tr("x (mm)"), tr("y (mm)"), "alignment", parent)
        self.getPlotItem().vb.invertY(True)

    def show_run(self, estimate: RunEstimate | None, checked: Validation | None) -> None:
        """Draw an estimate's alignment, else a validation's."""
        self.clear_all()
        found = checked.alignment if checked is not None else None
        if estimate is not None:
            found = estimate.alignment
        if found is None:
            name = estimate.id if estimate is not None else ""
            self.title_lines([escape(tr("No alignment for {run}").format(run=name))])
            return
        marks = (
            ("✕", theme().muted, tr("uncorrected")),
            ("▼", theme().blue, tr("top, shifted")),
            ("■", theme().orange, tr("bottom, shifted")),
        )
        self.name_above(escape(_title(estimate, checked)), marks, apart="<br>")
        self._draw(found)

    def _draw(self, found: Alignment) -> None:
        colours = theme()
        self.dots(tr("uncorrected"), found.x_raw_mm, found.y_raw_mm, colours.muted, "x", 8)
        for side, symbol, colour, name in (
            (-1, "t", colours.blue, tr("top, shifted")),
            (1, "s", colours.orange, tr("bottom, shifted")),
        ):
            here = found.side == side
            if not here.any():
                continue
            tips = [
                f"{1e3 * latency:.1f} ms\n{speed:.0f} mm/s\n{residual:+.2f} mm"
                for latency, speed, residual in zip(
                    found.latency_s[here], found.speed_mm_s[here], found.residual_mm[here], strict=True
                )
            ]
            self.dots(name, found.x_mm[here], found.y_mm[here], colour, symbol, 8, words=tips)
        lines = found.lines
        x = np.array([found.x_mm.min(), found.x_mm.max()])
        for name, slope, intercept, colour in (
            (tr("top line"), lines.slope_top, lines.intercept_top_mm, colours.blue),
            (tr("bottom line"), lines.slope_bottom, lines.intercept_bottom_mm, colours.orange),
        ):
            self.line(name, x, slope * x + intercept, colour, 1.5, legend=False)


class CostPlot(Plot):
    """J against a shift: how sharply data determine the latency."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("", tr("shift L (ms)"), tr("J per edge (mm²)"), "cost", parent)
        self.getPlotItem().setLogMode(y=False)
        self._shown = ""

    def show_run(self, run: Run, found: RunEstimate, stylus_mm: float, tasks: Tasks) -> None:
        """Scan in a worker, then draw."""
        self._shown = run.id

        def work(progress: Progress) -> Scan:
            ready = estimate.prepare(run, stylus_mm)
            edges = Edges(ready.edges.t_s, ready.edges.falling, ready.edges.n_rejected)
            return scan(ready.touch, edges, WINDOW_S, half_width_s=_SCAN_HALF_S, step_s=0.001)

        def done(result: Scan) -> None:
            if self._shown != run.id:
                return
            self.clear_all()
            finite = np.isfinite(result.cost_mm2)
            self.line(run.id, 1e3 * result.latency_s[finite], result.cost_mm2[finite], theme().blue, 2)
            if found.latency_s is not None:
                self.upright(tr("estimate"), 1e3 * found.latency_s, theme().orange, f"{words.ms(found.latency_s)} ms")
            self.title_lines([escape(run.id)])

        tasks.start(tr("Scanning"), work, done, lambda text: self.clear_all())


class WidthPlot(Plot):
    """The stylus' diameter by each run."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(
            tr("Width of the stylus, seen by the beam"), tr("drag speed (mm/s)"), tr("diameter (mm)"), "width", parent
        )
        self.add_legend()

    def show_runs(self, runs: Iterable[RunEstimate], session: Session | None) -> None:
        self.clear_all()
        good = [r for r in runs if r.stylus_diameter_mm is not None and r.speed_mm_s is not None]
        if not good:
            return
        speed = np.array([r.speed_mm_s for r in good], float)
        width = np.array([r.stylus_diameter_mm for r in good], float)
        error = np.array([1.96 * (r.stylus_diameter_se_mm or 0.0) for r in good])
        tips = [f"{r.id}\n{w:.2f} mm" for r, w in zip(good, width, strict=True)]
        self.dots(tr("runs"), speed, width, theme().orange, "o", error=error, words=tips)
        if session is not None:
            true_mm = session.stylus.diameter_mm
            both = np.array([speed.min(), speed.max()])
            self.line(tr("ruler"), both, np.array([true_mm, true_mm]), theme().green, 2, dash=True)


# The least range of tap latencies that is divided into bins.
_LEAST_MS = 0.1


class TapsPlot(Plot):
    """Tap latencies by kind, with medians."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(tr("Taps"), tr("latency (ms)"), tr("taps"), "taps", parent)
        self.add_legend()

    def show_taps(self, taps: Mapping[str, TapSummary]) -> None:
        self.clear_all()
        if not taps:
            self.title_lines([tr("No taps in this session")])
            return
        every = 1e3 * np.concatenate([summary.latency_s for summary in taps.values()])
        low, high = (every.min(), every.max()) if len(every) else (0.0, 1.0)
        room = max(0.0, _LEAST_MS - (high - low)) / 2  # taps that differ by rounding alone leave no width for bins
        edges = np.histogram_bin_edges(every, 24, (low - room, high + room))
        titles = []
        for kind, name, colour in (
            ("touch", tr("touch"), theme().blue),
            ("release", tr("release"), theme().orange),
        ):
            if kind not in taps:
                continue
            summary = taps[kind]
            count, _ = np.histogram(1e3 * summary.latency_s, edges)
            self.bars(name, (edges[1:] + edges[:-1]) / 2, count, float(edges[1] - edges[0]), colour)
            self.upright(f"{name} median", 1e3 * summary.median_s, colour)
            titles.append(
                tr("{name}: median {ms} ms of {n}").format(name=name, ms=words.ms(summary.median_s), n=summary.n)
            )
        self.title_lines(titles)


class ValidationView(Scrolled):
    """Misalignment the curve removes from other runs (Eq. 4)."""

    def __init__(self) -> None:
        box = QVBoxLayout()
        titles = [tr("run"), tr("target"), tr("J without (mm²)"), tr("J with"), tr("removed")]
        rows = table(titles, stretch=1)
        rows.setAccessibleName(tr("Validation"))
        plot = Plot(tr("Residual at each edge"), tr("drag speed (mm/s)"), tr("residual (mm)"), "validation")
        plot.add_legend(columns=2)
        box.addWidget(rows, 2)
        box.addWidget(plot, 3)
        super().__init__(box)
        self.table, self.plot = rows, plot

    def show_items(self, items: Iterable[Validation]) -> None:
        self.table.setRowCount(0)
        self.plot.clear_all()
        items = tuple(items)
        for k, item in enumerate(items):
            self.table.insertRow(k)
            for column, text in enumerate(
                (item.run, words.target_name(item.protocol), f"{item.j0_per_edge_mm2:.2f}",
                 f"{item.j_per_edge_mm2:.3f}", f"{item.delta_j_percent:.1f} %")
            ):  # fmt: skip
                self.table.setItem(k, column, QTableWidgetItem(text))
            colour = theme().series[k % len(theme().series)]
            name = f"{item.run} {words.target_name(item.protocol)}"
            self.plot.dots(name, item.speeds_mm_s, item.alignment.residual_mm, colour, "ostd+x"[k % 6], 7, hollow=True)
        if items:
            # With room for the legend's rows above the farthest of them.
            reach_mm = max(float(np.abs(item.alignment.residual_mm).max(initial=0.1)) for item in items)
            self.plot.setYRange(-1.1 * reach_mm, (1.1 + 0.4 * -(-len(items) // 2)) * reach_mm, padding=0)


def _title(estimate: RunEstimate | None, checked: Validation | None) -> str:
    if estimate is not None:
        return f"{estimate.id} · {words.number(estimate.speed_mm_s, 0)} mm/s · {words.latency_text(estimate)}"
    if checked is not None:
        name = words.target_name(checked.protocol)
        return f"{checked.run} · {name} · " + tr("{p:.1f} % of J removed").format(p=checked.delta_j_percent)
    return ""
