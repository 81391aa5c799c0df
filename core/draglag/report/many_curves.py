"""Many latency curves in one picture."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from draglag.curve import CurveFit
from draglag.curve.ranking import Ranking
from draglag.drawing import style

MOST_IN_COLOURS = 6  # curves whose colours can be distinguished
ACROSS = 6  # small pictures in a row
LETTERS = 18  # of a name over a small picture


def ranked_figure(ranking: Ranking) -> Any:
    """Mean latency of each curve with its 95 % interval, by rank."""
    n = len(ranking.places)
    figure = style.new_figure(7.2, 1.0 + 0.19 * n)
    axes = figure.add_subplot()
    mean = np.array([1e3 * place.mean_s for place in ranking.places])
    low, high = (np.array([1e3 * getattr(p, end) for p in ranking.places]) for end in ("low_s", "high_s"))
    axes.errorbar(mean, range(n), xerr=[mean - low, high - mean], fmt="o", color=style.BLUE, capsize=2, markersize=3.5)
    labels = [f"{_short(p.name, 40)}  {_ranks(p.rank_low, p.rank_high)}" for p in ranking.places]
    axes.set_yticks(range(n), labels, fontsize=7.5)
    axes.set_ylim(n - 0.4, -0.6)
    first, last = ranking.speed_range_mm_s
    axes.set(
        xlabel=f"mean latency, ms, {first:.0f} to {last:.0f} mm/s (95 %)",
        title="sessions in order, with the 95 % interval of their ranks",
    )
    return figure


def each_figure(curves: Mapping[str, CurveFit], ranking: Ranking) -> Any:
    """A picture of each curve, by rank, over all others."""
    rows = -(-len(ranking.places) // ACROSS)
    figure = style.new_figure(9.6, 0.4 + 1.15 * rows)
    grid = figure.subplots(rows, ACROSS, sharex=True, sharey=True, squeeze=False).ravel()
    lines = {}
    for name, curve in curves.items():
        speed = np.geomspace(max(curve.speed_range_mm_s[0], 1.0), curve.speed_range_mm_s[1], 60)
        lines[name] = speed, 1e3 * curve.predict_s(speed)
    for axes, place in zip(grid, ranking.places, strict=False):
        for speed, latency_ms in lines.values():
            axes.plot(speed, latency_ms, color="#dddddd", linewidth=0.5, zorder=1)
        speed, latency_ms = lines[place.name]
        band = [1e3 * edge for edge in curves[place.name].band_s(speed)]
        axes.fill_between(speed, *band, color=style.SKY, alpha=0.5, linewidth=0, zorder=2)
        axes.plot(speed, latency_ms, color=style.BLUE, linewidth=1.2, zorder=3)
        axes.set_title(f"{place.rank}. {_short(place.name, LETTERS)}", fontsize=7)
        axes.tick_params(labelsize=6.5)
        axes.grid(visible=False)
    grid[0].set_ylim(bottom=0)
    for k, axes in enumerate(grid):
        if k >= len(ranking.places):
            axes.set_axis_off()
        elif k + ACROSS >= len(ranking.places):  # the lowest of its column
            axes.tick_params(labelbottom=True)
            axes.set_xlabel("mm/s", fontsize=7)
    figure.supylabel("latency, ms", fontsize=8)
    return figure


def _short(name: str, letters: int) -> str:
    return name if len(name) <= letters else "…" + name[-letters + 1 :]


def _ranks(low: int, high: int) -> str:
    return str(low) if low == high else f"{low}–{high}"
