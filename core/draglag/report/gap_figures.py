"""Figures of a gap report."""

from __future__ import annotations

from textwrap import fill
from typing import Any

import numpy as np

from draglag.drawing.style import BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILION, new_figure, plain_log_ticks
from draglag.gap.constants import PROBABLE
from draglag.gap.fitting.heldout import noise_variance_mm2
from draglag.gap.fitting.joint import Fit
from draglag.gap.fitting.law_form import FlexibleLaw, nearest_eq5
from draglag.gap.provisional import Provisional
from draglag.gap.results import GapReport, followed
from draglag.report import replayed
from draglag.simulation.effects import title_of

HATCH = "///"
"""Of provisional bars."""
MARK = "~ "
"""Before their names."""
_LETTERS = 72  # of all names below the bars, next to each other


def ms_per_mm(fit: Fit) -> float:
    """Time for 1 mm across the beam at the session's RMS velocity."""
    return float(1e3 / np.sqrt(np.mean(fit.view.v_across**2)))


def waterfall(report: GapReport, provisional: Provisional | None = None) -> Any:
    """The held-out gap step by step, against the noise floor.

    Provisional bars are hatched: effects less probable than not, and a term without a name.
    """
    from matplotlib.patches import Patch

    figure = new_figure(7.2, 3.2)
    axes = figure.add_subplot()
    bars = _bars(report, provisional)
    for place, (_, value, colour, hatched) in enumerate(bars):
        look = {"facecolor": "none", "edgecolor": colour, "hatch": HATCH} if hatched else {"color": colour}
        axes.bar(place, value, width=0.55, **look)
        axes.annotate(
            f"{value:.3f}", (place, value), ha="center", va="bottom", xytext=(0, 2), textcoords="offset points",
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 1}, zorder=5,  # the noise floor may pass behind it
        )  # fmt: skip
    floor = axes.axhline(report.noise_floor_mm or 0.0, color=GREEN, linestyle="--", label="noise floor")
    letters = _LETTERS // max(len(bars), 2)
    axes.set_xticks(range(len(bars)), [fill(name, letters) for name, *_ in bars])
    axes.set_xlim(-0.6, max(len(bars), 2) - 0.4)
    axes.set_ylim(0, 1.2 * max([value for _, value, *_ in bars] + [report.noise_floor_mm or 0.0]))
    axes.set_ylabel("held-out gap (mm RMS)")
    if report.last is not None:
        ms = ms_per_mm(report.last)
        other = axes.secondary_yaxis("right", functions=(lambda mm: ms * mm, lambda late: late / ms))
        other.set_ylabel("(ms RMS)")
    unsure = [Patch(facecolor="none", edgecolor=PURPLE, hatch=HATCH, label="provisional")]
    axes.legend(handles=[floor, *(unsure if any(hatched for *_, hatched in bars) else [])], loc="upper right")
    return figure


def _bars(report: GapReport, provisional: Provisional | None) -> list[tuple[str, float, str, bool]]:
    """(name, gap in mm, colour, whether provisional) of each bar."""
    bars = [("present model", report.gap_first_mm or 0.0, ORANGE, False)]
    for step in report.steps:
        doubted = step.probability < PROBABLE
        name = f"+ {MARK if doubted else ''}{title_of(step.effect)}"
        bars.append((name, step.gap_after_mm, PURPLE if doubted else BLUE, doubted))
    if provisional is not None:
        name = f"+ {MARK}without a name: {followed(provisional.covariate)}"
        bars.append((name, provisional.gap_after_mm, PURPLE, True))
    return bars


def _series(first: Fit, last: Fit) -> list[tuple[Fit, str, str, str]]:
    after = (last, BLUE, "o", "present model" if first is last else "after")
    return [after] if first is last else [(first, ORANGE, "^", "before"), after]


def residuals(first: Fit, last: Fit) -> Any:
    figure = new_figure(7.2, 6.4)
    grid = figure.subplots(3, 2)
    covariates = [
        ("drag speed (mm/s)", "speed"),
        ("session time (s)", "since_start_s"),
        ("x (mm)", "x_mm"),
        ("time in run (s)", "in_run_s"),
        ("acceleration (mm/s²)", "accel"),
        ("normal acceleration (mm/s²)", "a_across"),
    ]
    for axes, (title, covariate) in zip(grid.ravel(), covariates, strict=True):
        for fit, colour, marker, name in _series(first, last):
            # As latency: a residual across the beam over the velocity across it keeps its sign in both directions.
            known = fit.known[fit.use]
            late_ms = 1e3 * fit.residual_mm / np.where(np.abs(fit.view.v_across) < 1, np.nan, fit.view.v_across)
            x = np.asarray(getattr(fit.view, covariate), float)[known]
            late_ms, weight = late_ms[known], np.square(fit.view.v_across)[known]
            middle, mean, reach = replayed.binned(x, late_ms, replayed.limits_in(x), weight)
            axes.errorbar(
                middle, mean, reach, color=colour, marker=marker, linestyle="-", lw=0.8, capsize=2, label=name
            )
        axes.axhline(0, color=GREY, lw=0.8)
        axes.set_xlabel(title)
        axes.set_ylabel("residual (ms)")
    grid[0, 0].set_xscale("log")
    plain_log_ticks(grid[0, 0].xaxis)
    grid[0, 0].legend(loc="best")
    return figure


def curves(report: GapReport) -> Any:
    figure = new_figure(7.2, 3.8)
    axes = figure.add_subplot()
    assert report.first is not None
    assert report.last is not None
    speed = np.geomspace(max(float(report.last.view.speed.min()), 20.0), float(report.last.view.speed.max()), 300)
    for fit, colour, _, name in _series(report.first, report.last):
        axes.plot(speed, 1e3 * fit.law(speed), color=colour, linestyle="-" if fit is report.last else "--", label=name)
    law = report.last.law
    if not report.law.adequate and isinstance(law, FlexibleLaw):
        axes.plot(
            speed,
            1e3 * nearest_eq5(law, report.last.view.speed)(speed),
            color=GREY,
            linestyle=":",
            label="nearest Eq. 5",
        )
    points = [
        (d.estimate.speed_mm_s, 1e3 * d.estimate.latency_s)
        for d in report.last.runs
        if d.estimate and d.estimate.latency_s is not None and d.estimate.speed_mm_s
    ]
    axes.plot(*np.array(points).T, "s", color=VERMILION, label="runs, as measured")
    axes.set_xlabel("drag speed (mm/s)")
    axes.set_ylabel("latency (ms)")
    axes.legend()
    return figure


def spread(first: Fit, last: Fit) -> Any:
    figure = new_figure(7.2, 3.2)
    axes = figure.add_subplot()
    variance = noise_variance_mm2(last)[last.known[last.use]]
    reach = 4 * float(np.sqrt(np.mean(variance))) + 1e-6
    bins = np.linspace(-reach, reach, 61).tolist()
    for fit, colour, _, name in _series(first, last):
        left_mm = np.clip(fit.residual_mm[fit.known[fit.use]], -reach, reach)
        axes.hist(left_mm, bins=bins, histtype="step", color=colour, lw=1.6, label=name)
    x = np.linspace(-reach, reach, 300)
    density = np.mean(
        np.exp(-0.5 * x[:, None] ** 2 / variance[None, :]) / np.sqrt(2 * np.pi * variance[None, :]), axis=1
    )
    axes.plot(x, density * variance.size * (bins[1] - bins[0]), color=GREEN, linestyle="--", label="noise alone")
    axes.set_xlabel("residual (mm); the outermost bars hold what lies beyond")
    axes.set_ylabel("edges")
    axes.legend()
    return figure
