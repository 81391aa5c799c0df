"""One figure of the benchmark: power, recall by effect, gap over floor, confusion."""

from pathlib import Path
from typing import Any

import numpy as np

from .judge import Outcome


def draw(path: Path, summary: dict[str, Any], outcomes: list[Outcome]) -> None:
    """Write the figure to `path`; its ending chooses the format."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14, 11), layout="constrained")
    axes = figure.subplots(2, 2, width_ratios=(1, 1.3))
    realistic = any(o.world == "realistic" for o in outcomes)
    _power(axes[0, 0], summary["power"], "0.05 mm RMS" if realistic else "just detectable")
    _gaps(axes[1, 0], outcomes)
    _recall(axes[0, 1], summary["rows"])
    _confusion(axes[1, 1], summary["confusion"])
    figure.savefig(path, dpi=110)


def draw_reliability(path: Path, worlds: dict[str, dict[str, Any]]) -> None:
    """Write the reliability diagram to `path`: one panel a world."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.5 * max(len(worlds), 1), 5.5), layout="constrained")
    for ax, (world, found) in zip(figure.subplots(1, len(worlds), squeeze=False)[0], worlds.items(), strict=True):
        ax.set(title=f"First names in the {world} world", xlabel="stated probability", ylabel="share right")
        ax.set(xlim=(-0.02, 1.02), ylim=(-0.02, 1.02))
        ax.plot([0, 1], [0, 1], color="0.6", lw=0.8, ls="--")
        bins = found["reliability"]["bins"]
        if not bins:
            ax.text(0.5, 0.6, "no probability stated", ha="center", va="center", color="0.3")
            continue
        x, y = np.array([b["stated"] for b in bins]), np.array([b["rate"] for b in bins])
        low, high = np.array([b["ci95"] for b in bins]).T
        ax.errorbar(x, y, yerr=np.maximum([y - low, high - y], 0), fmt="o-", capsize=3)
        for b in bins:
            ax.annotate(f"{b['n']}", (b["stated"], b["rate"]), (5, -11), textcoords="offset points", fontsize=8)
    figure.savefig(path, dpi=110)


def _power(ax: Any, power: list[dict[str, Any]], unit: str) -> None:
    ax.set(title="Right name first, against size", xlabel=f"size / {unit}", ylabel="rate", ylim=(-0.02, 1.02))
    if power:
        x = [np.sqrt(max(p["from"], 0.25) * (p["to"] or 2 * p["from"])) for p in power]
        y = np.array([p["rate"] for p in power])
        low, high = np.array([p["ci95"] for p in power]).T
        ax.errorbar(x, y, yerr=np.maximum([y - low, high - y], 0), fmt="o-", capsize=3)
        ax.set_xscale("log")
    ax.axhline(0.95, color="0.6", lw=0.8, ls="--")


def _gaps(ax: Any, outcomes: list[Outcome]) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter

    ax.set(title="Held-out gap against the floor", xlabel="gap of the twin without the effect, mm", ylabel="gap, mm")
    found = False
    for what, marker in (("gap_first_mm", "x"), ("gap_last_mm", "o")):
        points = [(o.floor_mm, getattr(o, what)) for o in outcomes if o.hidden and o.floor_mm and getattr(o, what)]
        if points:
            found = True
            label = "before" if what == "gap_first_mm" else "after"
            ax.loglog(*zip(*points, strict=True), marker, ms=4, alpha=0.6, label=label)
    if found:
        ax.legend()
    floors = [o.floor_mm for o in outcomes if o.floor_mm]
    if floors:
        for axis in (ax.xaxis, ax.yaxis):  # 0.05, 0.1, 0.2 …: words for each tick would meet
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.set_major_formatter("{x:g}")
            axis.set_minor_formatter(NullFormatter())
        ends = np.array([min(floors), max(floors)])
        ax.plot(ends, ends, color="0.4", lw=0.8)
        ax.plot(ends, 1.1 * ends, color="0.4", lw=0.8, ls="--")


def _recall(ax: Any, rows: list[dict[str, Any]]) -> None:
    singles = [row for row in rows if row["kind"] == "single"]
    names = sorted({row["row"] for row in singles})
    scales = sorted({row["scale"] for row in singles})
    for k, scale in enumerate(scales):
        at = {row["row"]: row["right"]["rate"] for row in singles if row["scale"] == scale}
        where = np.arange(len(names)) + (k - (len(scales) - 1) / 2) * 0.8 / max(len(scales), 1)
        ax.bar(where, [at.get(name, 0.0) for name in names], 0.8 / max(len(scales), 1), label=f"{scale:g} × nominal")
    ax.set(title="Right name first, by effect and size", ylim=(0, 1.02))
    ax.set_xticks(range(len(names)), names, rotation=75, fontsize=8)
    ax.axhline(0.95, color="0.4", lw=0.8, ls="--")
    if singles:
        ax.legend(fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 1.08), ncols=len(scales))


def _confusion(ax: Any, confusion: dict[str, dict[str, int]]) -> None:
    rows = list(confusion)
    said = sorted({name for row in confusion.values() for name in row}, key=lambda name: [*rows, name].index(name))
    counts = np.array([[confusion[row].get(name, 0) for name in said] for row in rows], dtype=float)
    ax.set(title="Hidden (rows) against first name given (columns)")
    if counts.size:
        share = counts / counts.sum(axis=1, keepdims=True)
        ax.imshow(share, cmap="Blues", aspect="auto", vmin=0, vmax=1)
        for i, j in np.argwhere(counts > 0):
            color = "white" if share[i, j] > 0.5 else "black"
            ax.text(j, i, f"{counts[i, j]:.0f}", ha="center", va="center", fontsize=7, color=color)
    ax.set_xticks(range(len(said)), said, rotation=75, fontsize=7)
    ax.set_yticks(range(len(rows)), rows, fontsize=7)
