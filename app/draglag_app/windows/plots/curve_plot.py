"""Latency against speed."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from PySide6.QtWidgets import QWidget

from draglag.curve import CurveFit
from draglag.latency import RunEstimate
from draglag_app.windows.parts.theme import theme
from draglag_app.windows.plots.plot import Plot, tr
from draglag_app.windows.plots.plot_values import Column
from draglag_app.windows.wording import words

SYMBOLS = ("o", "s", "t", "d", "x")
_FEW_NAMES = 4  # that a legend has one below the other: more take the height from the runs
_AROUND_PX = 30  # from the legend to the corner, and half a point of a run
_LEAST_BELOW = 0.1  # of the height: a plot that is lower than its legend shows no runs below it


class CurvePlot(Plot):
    """Runs, the curve with its band, alternatives."""

    def __init__(self, title: str = "", parent: QWidget | None = None, named_above: bool = False) -> None:
        self._named_above = ""
        self._base: CurveFit | None = None  # subtracted from what is drawn
        super().__init__(title, tr("drag speed (mm/s)"), tr("latency (ms)"), "latency-curve", parent)
        if named_above:  # where a legend would cover what there is to see
            self._named_above = title
            self.restyle()
        else:
            self.add_legend()

    def restyle(self) -> None:
        super().restyle()
        if self._named_above:
            marks = (("●", theme().orange, tr("runs")), ("─", theme().blue, tr("curve")))
            self.name_above(self._named_above, marks)

    def draw(
        self,
        estimates: Iterable[RunEstimate],
        curve: CurveFit | None,
        excluded: Iterable[str] = (),
        alternatives: Iterable[CurveFit] = (),
        clicked: Callable[[str], None] | None = None,
        residuals: bool = False,
    ) -> None:
        """Draw again. ``clicked`` gets a run's id. ``residuals``: latency minus curve, where intervals are wide enough
        to see."""
        self.clear_all()
        colours, out, alternatives = theme(), set(excluded), tuple(alternatives)
        good = [e for e in estimates if e.latency_s is not None and e.speed_mm_s is not None]
        self._base = curve if residuals else None
        axis = tr("latency (ms)") if self._base is None else tr("latency − curve (ms)")
        if axis != self._labels[2]:
            self.relabel(self._labels[0], self._labels[1], axis)
        if curve is not None:
            self.draw_curve(tr("curve"), curve, colours.blue, "" if self._named_above else tr("95 % band"))
        self._draw_alternatives(alternatives)
        kept = [e for e in good if e.id not in out]
        for name, chosen, symbol, colour in (
            (tr("runs"), [e for e in kept if not e.flags], "o", colours.orange),
            (tr("runs with a flag"), [e for e in kept if e.flags], "t", colours.orange),
            (tr("excluded"), [e for e in good if e.id in out], "x", colours.muted),
        ):
            if chosen:
                self._runs(name, chosen, symbol, colour, clicked)
        self._spread_legend()
        if good:
            self._fit_ranges(good, out)

    def _draw_alternatives(self, alternatives: tuple[CurveFit, ...]) -> None:
        colours = (theme().green, theme().purple, theme().sky, theme().orange)
        for k, alternative in enumerate(alternatives):
            speed = speeds_of(alternative)
            latency_ms = self._less_base_ms(speed, alternative.predict_s(speed))
            self.line(words.form_name(alternative.form), speed, latency_ms, colours[k % 4], 1.5, dash=True)

    def _spread_legend(self) -> None:
        """Many names in two columns, if the plot is wide enough for them."""
        if self.legend is None:
            return
        self.legend.setColumnCount(2 if len(self.legend.items) > _FEW_NAMES else 1)
        if self.legend.boundingRect().width() + _AROUND_PX > self.getPlotItem().vb.boundingRect().width():
            self.legend.setColumnCount(1)

    def _fit_ranges(self, good: list[RunEstimate], out: set[str]) -> None:
        # The margin below is for the labels of zero.
        fastest_mm_s = 1.05 * max(200.0, *(e.speed_mm_s or 0.0 for e in good))
        self.setXRange(0, fastest_mm_s, padding=0.02)
        if self._base is None:
            above = 1.15 * max(50.0, *(1e3 * (e.latency_s or 0.0) for e in good))
            self.setYRange(0, max(above, self._top_below_legend_ms(good, fastest_mm_s)), padding=0.03)
            return
        kept = [e for e in good if e.id not in out] or good
        reach = [np.abs(self._less_base_ms(e.speed_mm_s, e.latency_s)) + _half_ms(e) for e in kept]
        most_ms = 1.1 * float(np.nanmax([*np.ravel(reach), 1e-3]))
        self.setYRange(-most_ms, most_ms, padding=0)

    def _top_below_legend_ms(self, good: list[RunEstimate], fastest_mm_s: float) -> float:
        """Upper end of the range with which the legend, in the upper right corner, covers no run."""
        if self.legend is None:
            return 0.0
        view, box = self.getPlotItem().vb.boundingRect(), self.legend.boundingRect()
        left, below = (
            1 - (size + _AROUND_PX) / max(whole, 1.0)
            for size, whole in ((box.width(), view.width()), (box.height(), view.height()))
        )
        fast = [e for e in good if (e.speed_mm_s or 0.0) > left * fastest_mm_s]
        highest_ms = max((1e3 * (e.latency_s or 0.0) + float(_half_ms(e)) for e in fast), default=0.0)
        return highest_ms / float(max(below, _LEAST_BELOW))

    def _less_base_ms(self, speed_mm_s: Column | float | None, latency_s: Column | float | None) -> np.ndarray:
        latency = np.asarray(latency_s, float)
        return 1e3 * (latency if self._base is None else latency - self._base.predict_s(np.asarray(speed_mm_s, float)))

    def _runs(
        self,
        name: str,
        chosen: list[RunEstimate],
        symbol: str,
        colour: str,
        clicked: Callable[[str], None] | None,
    ) -> None:
        speed = np.array([e.speed_mm_s for e in chosen], float)
        self.dots(
            name,
            speed,
            self._less_base_ms(speed, np.array([e.latency_s for e in chosen], float)),
            colour,
            symbol,
            error=np.array([_half_ms(e) for e in chosen]),
            words=[f"{e.id}\n{words.number(e.speed_mm_s, 0)} mm/s\n{words.latency_text(e)}" for e in chosen],
            clicked=None if clicked is None else (lambda k: clicked(chosen[k].id)),
        )

    def draw_curve(self, name: str, curve: CurveFit, colour: str, band: str = "") -> None:
        """Draw a curve and its 95 % band; ``band``: name in the legend."""
        speed = speeds_of(curve)
        low_ms, high_ms = (self._less_base_ms(speed, edge_s) for edge_s in curve.band_s(speed))
        self.band(name + " 95 %", speed, low_ms, high_ms, colour, band)
        self.line(name, speed, self._less_base_ms(speed, curve.predict_s(speed)), colour, 2.5)


def speeds_of(curve: CurveFit) -> np.ndarray:
    """Speeds to draw a curve at, (400,) mm/s."""
    return np.linspace(*curve.speed_range_mm_s, 400)


def _half_ms(estimate: RunEstimate) -> float:
    if estimate.latency_ci95_s is None:
        return 0.0
    return 500 * (estimate.latency_ci95_s[1] - estimate.latency_ci95_s[0])
