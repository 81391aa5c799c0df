"""The figures of a report."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np

from draglag.analysis import Analysis, with_stylus
from draglag.drawing import style
from draglag.drawing.results import TAP_STYLE, draw_latency
from draglag.latency.estimate import Alignment
from draglag.recording import Run, Session

_TITLE_LETTERS = 60  # that go on a line above a small figure
_SOURCE_PT = 14.0  # of a figure's foot: the line of its source (style.sign), which a legend there would cover


def latency_figure(analysis: Analysis) -> Any:
    """Latency against speed (Fig. 5)."""
    figure = style.new_figure()
    axes = figure.add_subplot()
    draw_latency(axes, analysis)
    return figure


def alignment_figure(run: Run, alignment: Alignment, title: str, session: Session) -> Any:
    """One run's touch path, edges and lines (Fig. 4)."""
    figure = style.new_figure(5.6, 4.2)  # two stand side by side on the page
    axes = figure.add_subplot()
    axes.plot(run.touch.x_mm, run.touch.y_mm, color=style.GREY, linewidth=0.5, alpha=0.7, label="touch path")
    for falling, marker, name in ((True, "v", "light→dark"), (False, "^", "dark→light")):
        some = np.asarray(alignment.falling, bool) == falling
        for x_mm, y_mm, colour, state in (
            (alignment.x_raw_mm, alignment.y_raw_mm, style.VERMILION, "raw"),
            (alignment.x_mm, alignment.y_mm, style.BLUE, "corrected"),
        ):
            filled = {"markerfacecolor": "none"} if state == "raw" else {}
            axes.plot(
                x_mm[some],
                y_mm[some],
                marker,
                color=colour,
                markersize=4.5,
                linestyle="none",
                label=f"{state}, {name}",
                **filled,
            )
    lines = alignment.lines
    ends = np.array([alignment.x_mm.min(), alignment.x_mm.max()])
    both = ((lines.slope_top, lines.intercept_top_mm), (lines.slope_bottom, lines.intercept_bottom_mm))
    for k, (slope, intercept_mm) in enumerate(both):
        label = "top and bottom line" if k == 0 else None
        axes.plot(ends, slope * ends + intercept_mm, color=style.BLACK, linewidth=1.2, label=label, zorder=4)
    axes.set(xlabel="x, mm", ylabel="y, mm (down the screen)", title=textwrap.fill(title, _TITLE_LETTERS))
    axes.set_aspect("equal", adjustable="datalim")
    axes.invert_yaxis()
    _legend_at_the_foot(figure, axes)
    return figure


def _legend_at_the_foot(figure: Any, axes: Any) -> None:
    """A legend below the axes, above the line of the source."""
    legend = figure.legend(
        *axes.get_legend_handles_labels(), loc="outside lower center", ncols=3, columnspacing=1.2, handlelength=1.5
    )
    legend.borderaxespad += _SOURCE_PT / legend.prop.get_size_in_points()
    foot = _SOURCE_PT / 72 / figure.get_figheight()
    figure.get_layout_engine().set(rect=(0, foot, 1, 1 - foot))


def width_figure(analysis: Analysis, session: Session) -> Any:
    """Stylus width against speed (Fig. 7)."""
    figure = style.new_figure(7.2, 3.2)
    axes = figure.add_subplot()
    runs = [run for run in analysis.runs if run.stylus_diameter_mm is not None and run.speed_mm_s is not None]
    speed = np.array([run.speed_mm_s for run in runs], float)
    width = np.array([run.stylus_diameter_mm for run in runs], float)
    se = np.array([run.stylus_diameter_se_mm or 0.0 for run in runs], float)
    true_mm = with_stylus(session, analysis.options.stylus_mm).stylus.diameter_mm
    axes.axhline(true_mm, color=style.BLACK, linestyle="--", label="true width")
    bars = {"yerr": 1.96 * se} if se.any() else {}
    label = "estimated, 95 % interval" if bars else "estimated"
    axes.errorbar(speed, width, fmt="D", color=style.BLUE, capsize=2.5, elinewidth=1.1, label=label, **bars)
    axes.set(xlabel="drag speed, mm/s", ylabel="stylus width, mm")
    axes.set_xlim(left=0)
    low, high = axes.get_ylim()
    reach = max(1.0, high - true_mm, true_mm - low)
    axes.set_ylim(true_mm - reach, true_mm + reach)
    axes.legend(loc="lower right", ncols=2)
    return figure


def taps_figure(analysis: Analysis) -> Any:
    """Tap latency (Fig. 6)."""
    figure = style.new_figure(7.2, 2.6)
    axes = figure.add_subplot()
    names = list(analysis.taps)
    rng = np.random.default_rng(0)  # spreads the points, so that equal ones stay visible
    for place, name in enumerate(names):
        latency_ms = 1e3 * analysis.taps[name].latency_s
        colour, marker, _ = TAP_STYLE[name]
        axes.boxplot(
            [latency_ms],
            positions=[place],
            orientation="horizontal",
            widths=0.5,
            showfliers=False,
            medianprops={"color": style.BLACK, "linewidth": 2},
            boxprops={"color": style.BLACK},
            manage_ticks=False,
        )
        spread = place + rng.uniform(-0.17, 0.17, latency_ms.size)
        axes.plot(latency_ms, spread, marker, color=colour, alpha=0.55, markersize=3.5, linestyle="none")
    axes.set_yticks(range(len(names)), [f"{name}\n(n = {analysis.taps[name].n})" for name in names])
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_xlabel("tap latency, ms")
    axes.grid(visible=False, axis="y")
    return figure


def speeds_figure(analysis: Analysis) -> Any:
    """Crossing speeds of validation runs on the curve (Fig. 8)."""
    figure = style.new_figure(7.2, 3.4)
    axes = figure.add_subplot()
    curve = analysis.curve
    assert curve is not None
    low, high = curve.speed_range_mm_s
    speed = np.linspace(max(low, 1.0), high, 300)
    axes.plot(speed, 1e3 * curve.predict_s(speed), color=style.BLACK, label="curve, measured range")
    markers = [(style.VERMILION, "o"), (style.GREEN, "s"), (style.BLUE, "^"), (style.PURPLE, "D"), (style.ORANGE, "v")]
    kinds = list(dict.fromkeys(item.protocol for item in analysis.validation))
    for kind, (colour, marker) in zip(kinds, markers, strict=False):
        same = [item for item in analysis.validation if item.protocol == kind]
        speeds = np.concatenate([item.speeds_mm_s for item in same])
        latency = 1e3 * np.concatenate([item.latency_s for item in same])
        axes.plot(speeds, latency, marker, color=colour, markersize=4, alpha=0.6, linestyle="none", label=kind)
    axes.set(xlabel="speed at the crossing, mm/s", ylabel="latency from the curve, ms")
    axes.set_ylim(bottom=0)
    axes.set_xlim(left=0)
    axes.legend(loc="upper right")
    return figure
