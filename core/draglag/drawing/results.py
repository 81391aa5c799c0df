"""Results drawn on given axes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from draglag.arguments import other
from draglag.drawing import style
from draglag.messages import message
from draglag.system.packages import need

if TYPE_CHECKING:
    from draglag.analysis import Analysis
    from draglag.curve import CurveFit
    from draglag.curve.compare import CurveDifference
    from draglag.latency import RunEstimate

TAP_STYLE = {"touch": (style.VERMILION, "^", "--"), "release": (style.PURPLE, "v", ":")}


def own_axes(axes: Any | None) -> Any:
    """The axes given, else of a new pyplot figure. Raises DataError for no axes, DraglagError without matplotlib."""
    need("matplotlib")
    if axes is not None:
        if not hasattr(axes, "fill_between"):
            raise other(message("axes"), axes, message("Give axes of matplotlib, or none"))
        return axes
    from matplotlib import pyplot

    return pyplot.subplots()[1]


def draw_curve(axes: Any, curve: CurveFit, label: str = "", colour: str = style.BLUE, band: str = style.SKY) -> None:
    """A curve over its measured range, with its 95 % band."""
    low, high = curve.speed_range_mm_s
    speed = np.geomspace(max(low, 1.0), max(high, 1.0), 300)
    edges = [1e3 * edge for edge in curve.band_s(speed)]
    axes.fill_between(speed, *edges, color=band, alpha=0.35, linewidth=0, label="95 % band of the curve")
    axes.plot(speed, 1e3 * curve.predict_s(speed), color=colour, label=label or f"fit: {curve.form.replace('_', ' ')}")
    axes.set(xlabel="drag speed, mm/s", ylabel="latency, ms")


def draw_latency(axes: Any, analysis: Analysis) -> None:
    """Latency against speed, with curve, band and tap medians (Fig. 5)."""
    runs = [run for run in analysis.runs if run.latency_s is not None and run.speed_mm_s is not None]
    used = [run for run in runs if run.id not in analysis.excluded]
    sound, flagged = [run for run in used if not run.flags], [run for run in used if run.flags]
    if analysis.curve is not None:
        draw_curve(axes, analysis.curve)
    _draw_runs(axes, sound, "s", style.BLACK, "run, 95 % interval")
    _draw_runs(axes, flagged, "X", style.ORANGE, "run with a warning")
    _draw_runs(axes, [run for run in runs if run.id in analysis.excluded], "x", style.GREY, "run not in the curve")
    for name, taps in analysis.taps.items():
        colour, marker, dashes = TAP_STYLE[name]
        axes.axhline(1e3 * taps.median_s, color=colour, linestyle=dashes, linewidth=1.2)
        label = f"tap, {name}: median {1e3 * taps.median_s:.1f} ms"
        # Beyond the fastest run: a tap stands for an infinitely fast drag, and must not cover a run.
        right = 1.05 * max((run.speed_mm_s or 0.0 for run in runs), default=1000.0)
        axes.plot([right], [1e3 * taps.median_s], marker, color=colour, linestyle=dashes, label=label, zorder=4)
    axes.set(xlabel="drag speed, mm/s", ylabel="latency, ms")
    axes.set_ylim(bottom=0)
    axes.set_xlim(left=0)
    if runs or analysis.taps:
        axes.legend(loc="upper right")


def _draw_runs(axes: Any, runs: list[RunEstimate], marker: str, colour: str, label: str) -> None:
    if runs:
        axes.errorbar(
            [run.speed_mm_s for run in runs],
            [run.latency_ms for run in runs],
            yerr=_bars(runs),
            fmt=marker,
            color=colour,
            capsize=2.5,
            elinewidth=1.1,
            label=label,
            zorder=3,
        )


def draw_difference(axes: Any, difference: CurveDifference) -> None:
    """Second curve less first, with its 95 % band."""
    band = (1e3 * difference.low_s, 1e3 * difference.high_s)
    axes.fill_between(difference.speed_mm_s, *band, color=style.SKY, alpha=0.35, linewidth=0)
    axes.plot(difference.speed_mm_s, 1e3 * difference.difference_s, color=style.BLUE)
    axes.axhline(0, color=style.BLACK, linewidth=0.8)
    axes.set(xlabel="drag speed, mm/s", ylabel="difference of latencies, ms")


def _bars(runs: list[RunEstimate]) -> Any:
    bars = np.zeros((2, len(runs)))
    for k, run in enumerate(runs):
        if run.latency_ci95_ms is not None and run.latency_ms is not None:
            bars[:, k] = run.latency_ms - run.latency_ci95_ms[0], run.latency_ci95_ms[1] - run.latency_ms
    return np.maximum(bars, 0)
