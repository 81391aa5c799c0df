"""A session simulated again, drawn over the measured one."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from typing import Any

import numpy as np

from draglag.drawing.style import BLACK, BLUE, GREY, ORANGE, new_figure, plain_log_ticks
from draglag.gap.replaying.replay import Overlay, Replay
from draglag.gap.results import GapReport
from draglag.recording import FloatArray
from draglag.simulation.effects import effect_class, title_of

BINS = 12
MOST_LABELS = 20  # of runs: more, at 45°, run into each other. Derived: the figure's width over a letter's height
# Covariate of the gap report → how a view has it, and how people call it.
AXES = {
    "speed": ("speed", "drag speed (mm/s)"),
    "session_time": ("since_start_s", "session time (s)"),
    "x": ("x_mm", "x (mm)"),
    "time_in_run": ("in_run_s", "time in run (s)"),
    "acceleration": ("accel", "acceleration (mm/s²)"),
    "normal_acceleration": ("a_across", "normal acceleration (mm/s²)"),
    "kind_of_edge": ("rising", "kind of edge"),
    "direction": ("v_across", "direction of travel"),
    "direction_angle": ("angle", "direction of travel (rad)"),
}
OFTEN = ("speed", "session_time", "x", "time_in_run", "acceleration", "normal_acceleration")
Bins = tuple[FloatArray, FloatArray, FloatArray]


def binned(x: FloatArray, y: FloatArray, limits: FloatArray, weight: FloatArray | None = None) -> Bins:
    """Middle, weighted mean and half width (95 %) of bins with more than three values."""
    which = np.clip(np.searchsorted(limits, x, side="right") - 1, 0, limits.size - 2)
    w = np.ones(np.shape(y)) if weight is None else weight
    rows = []
    for k in range(limits.size - 1):
        own = (which == k) & np.isfinite(y) & (w > 0)
        if np.count_nonzero(own) > 3:
            total = float(w[own].sum())
            mean = float(w[own] @ y[own]) / total
            reach = 1.96 * float(np.sqrt(np.sum((w[own] * (y[own] - mean)) ** 2))) / total
            rows.append((float(np.median(x[own])), mean, reach))
    table = np.array(rows).reshape(-1, 3)
    return table[:, 0], table[:, 1], table[:, 2]


def against(overlay: Overlay, covariate: str, limits: FloatArray) -> Bins:
    """Residuals of an overlay as latency, binned over a covariate.

    Weighted by squared velocity across the beam, as edges of a slow stylus do not constrain latency.
    """
    attribute, _ = AXES[covariate]
    x = np.asarray(getattr(overlay.view, attribute), float)
    if covariate == "direction":
        x = np.sign(x)
    return binned(x, overlay.late_ms, limits, np.square(overlay.view.v_across))


def limits_of(measured: Overlay, covariate: str) -> FloatArray:
    """Bin limits with equally many edges, or a bin for each of two kinds."""
    if covariate == "kind_of_edge":
        return np.array([-0.5, 0.5, 1.5])
    if covariate == "direction":
        return np.array([-1.5, 0.0, 1.5])
    return limits_in(np.asarray(getattr(measured.view, AXES[covariate][0]), float))


def limits_in(values: FloatArray) -> FloatArray:
    """Limits of bins with equally many values."""
    limits: FloatArray = np.unique(np.quantile(values, np.linspace(0, 1, BINS + 1)))
    return limits if limits.size > 1 else np.array([limits[0] - 1, limits[0] + 1])


def _panel(axes: Any, covariate: str, series: Sequence[tuple[Overlay | None, str, str, str]]) -> None:
    measured = series[0][0]
    assert measured is not None
    limits = limits_of(measured, covariate)
    for k, (overlay, colour, marker, name) in enumerate(series):
        if overlay is None:
            continue
        middle, mean, reach = against(overlay, covariate, limits)
        if k == 0:
            axes.errorbar(middle, mean, reach, color=colour, marker=marker, linestyle="", capsize=2, label=name)
            continue
        axes.plot(middle, mean, color=colour, marker=marker, markersize=4, lw=1.2, label=name)
        axes.fill_between(middle, mean - reach, mean + reach, color=colour, alpha=0.18, lw=0)
    axes.axhline(0, color=GREY, lw=0.8)
    axes.set_xlabel(AXES[covariate][1])
    axes.set_ylabel("residual (ms)")
    if covariate == "speed":
        axes.set_xscale("log")
        plain_log_ticks(axes.xaxis)
    if covariate == "kind_of_edge":
        axes.set_xticks([0, 1], ["beam blocked", "beam clear"])
    if covariate == "direction":
        axes.set_xticks([-1, 1], ["up", "down"])


def _models(before: Replay, after: Replay) -> list[tuple[Replay, str, str, str]]:
    if before is after:
        return [(before, BLUE, "o", "simulated")]
    return [(before, ORANGE, "^", "simulated, before"), (after, BLUE, "o", "simulated, after")]


def edges_figure(before: Replay, after: Replay) -> Any:
    """The beam at one crossing, and differences of edge times by run."""
    figure = new_figure(7.2, 5.6)
    top, bottom = figure.subplots(2, 1, height_ratios=[1, 1.3])
    models = _models(before, after)
    _draw_light(top, before, models)
    _draw_edge_differences(bottom, before, models)
    return figure


def _draw_light(top: Any, before: Replay, models: Any) -> None:
    k = _most_deviating_run(before)
    own = np.flatnonzero(before.run == k)
    name = before.runs[k].id
    # Two whole shadows in the middle of the run.
    start = _darkening(before, own)
    chosen = own[start : start + 4]
    origin = before.measured_s[chosen[0]]
    lines = [(before, BLACK, "s", "measured"), *models]
    for row, (replay, colour, _, text) in enumerate(lines):
        times = replay.measured_s if row == 0 else replay.simulated_s
        mine = np.isin(replay.measured_s, before.measured_s[chosen])
        t, falls = 1e3 * (times[mine] - origin), replay.falling[mine]
        level = 2 - row
        ends = np.concatenate([[-40.0], t, [t[-1] + 40]]) if t.size else np.array([0.0, 0.0])
        light = np.concatenate([[1.0 if falls[0] else 0.0], np.where(falls, 0.0, 1.0)]) if t.size else np.ones(1)
        top.step(ends, level + 0.7 * np.append(light, light[-1]), where="post", color=colour, lw=1.6, label=text)
        if row == 0:
            for edge in t:
                top.axvline(edge, color=GREY, lw=0.7, linestyle=":")
    top.set_yticks([2.35 - row for row in range(len(lines))], [text for *_, text in lines])
    top.set_xlabel("time (ms)")
    top.set_title(f"Light on the sensor in {name}, {_speed(before, k):.0f} mm/s")
    top.grid(axis="y", visible=False)


def _draw_edge_differences(bottom: Any, before: Replay, models: Any) -> None:
    order = sorted(range(len(before.runs)), key=lambda r: _speed(before, r))
    order = [r for r in order if np.count_nonzero(before.run == r)]
    shifts = (-0.17, 0.17) if len(models) > 1 else (0.0,)
    for shift, (replay, colour, marker, text) in zip(shifts, models, strict=True):
        middle, low, high = [], [], []
        for r in order:
            d = replay.difference_ms[(replay.run == r) & np.isfinite(replay.difference_ms)]
            q = np.quantile(d, [0.025, 0.5, 0.975]) if d.size else np.full(3, np.nan)
            middle.append(q[1])
            low.append(q[1] - q[0])
            high.append(q[2] - q[1])
        at = np.arange(len(order)) + shift
        bottom.errorbar(at, middle, [low, high], color=colour, marker=marker, linestyle="", capsize=2, label=text)
    bottom.axhline(0, color=GREY, lw=0.8)
    labels = [f"{_speed(before, r):.0f}" if before.runs[r].measured else before.runs[r].protocol for r in order]
    every = max(1, ceil(len(order) / MOST_LABELS))
    bottom.set_xticks(np.arange(len(order))[::every], labels[::every], rotation=45 if len(order) > 12 else 0)
    bottom.set_xlabel("runs, by drag speed (mm/s)")
    bottom.set_ylabel("simulated − measured edge (ms)")
    bottom.legend(loc="best")


def _most_deviating_run(replay: Replay) -> int:
    ids = [int(k) for k in np.unique(replay.run) if np.count_nonzero(replay.run == k) >= 8]
    if not ids:
        return int(replay.run[0])
    return max(ids, key=lambda k: float(np.nan_to_num(np.nanmedian(np.abs(replay.difference_mm[replay.run == k])))))


def _darkening(replay: Replay, own: np.ndarray) -> int:
    """Index, near the middle of a run's edges, where four in a row alternate, dark first."""
    falls = replay.falling[own]
    good = [k for k in range(len(own) - 3) if falls[k] and not falls[k + 1] and falls[k + 2] and not falls[k + 3]]
    return min(good, key=lambda k: abs(k - len(own) // 2)) if good else 0


def _speed(replay: Replay, k: int) -> float:
    estimate = replay.runs[k].measured
    if estimate is not None and estimate.speed_mm_s is not None:
        return float(estimate.speed_mm_s)
    return float("inf")


def residuals_figure(before: Replay, after: Replay) -> Any:
    """Residuals under the present model against each covariate."""
    figure = new_figure(7.2, 7.0)
    grid = figure.subplots(3, 2)
    simulated = [(replay.simulated, colour, marker, name) for replay, colour, marker, name in _models(before, after)]
    series = ((before.measured, BLACK, "s", "measured"), *simulated)
    for axes, covariate in zip(grid.ravel(), OFTEN, strict=True):
        _panel(axes, covariate, series)
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure


def steps_figure(replays: Sequence[Replay], report: GapReport) -> Any:
    """Residual of each step against its covariate, without and with it."""
    steps = [
        (k, s.effect, effect_class(s.effect).follows if effect_class(s.effect).follows in AXES else "speed")
        for k, s in enumerate(report.steps)
    ]
    if not steps:
        return None
    figure = new_figure(7.2, 2.9 * len(steps))
    grid = np.atleast_1d(figure.subplots(len(steps), 1))
    for axes, (k, effect, covariate) in zip(grid, steps, strict=True):
        series = (
            (replays[0].measured, BLACK, "s", "measured"),
            (replays[k].simulated, ORANGE, "^", "simulated without it"),
            (replays[k + 1].simulated, BLUE, "o", f"simulated with {title_of(effect)}"),
        )
        _panel(axes, covariate, series)
        axes.set_title(f"Step {k + 1}: {title_of(effect)}")
        axes.legend(loc="best")
    return figure


def latencies_figure(before: Replay, after: Replay) -> Any:
    """Latency of runs against speed, measured and simulated."""
    figure = new_figure(7.2, 5.0)
    axes, under = figure.subplots(2, 1, sharex=True, height_ratios=[2, 1])
    measured = before.latencies_ms()
    if measured:
        v, y, e = (np.array([row[k] for row in measured]) for k in (1, 2, 3))
        axes.errorbar(v, y, 1.96 * e, color=BLACK, marker="s", linestyle="", capsize=2, label="measured")
    for replay, colour, marker, name in _models(before, after):
        rows = replay.latencies_ms()
        if not rows:
            continue
        v, m, me, s, se = (np.array([row[k] for row in rows]) for k in (1, 2, 3, 4, 5))
        axes.errorbar(v, s, 1.96 * se, color=colour, marker=marker, linestyle="", capsize=2, label=name, mfc="none")
        under.errorbar(v, s - m, 1.96 * np.hypot(me, se), color=colour, marker=marker, linestyle="", capsize=2)
    under.axhline(0, color=GREY, lw=0.8)
    under.set_xlabel("drag speed (mm/s)")
    under.set_ylabel("simulated −\nmeasured (ms)")
    axes.set_ylabel("latency (ms)")
    axes.set_xscale("log")
    plain_log_ticks(axes.xaxis)
    axes.legend()
    return figure


def spread_figure(before: Replay, after: Replay) -> Any:
    """Distribution of residuals under the present model."""
    figure = new_figure(7.2, 3.2)
    axes = figure.add_subplot()
    reach = 1.1 * float(np.quantile(np.abs(before.measured.residual_mm), 0.99)) + 1e-6
    bins = np.linspace(-reach, reach, 51).tolist()
    simulated = [
        (r.simulated, colour, "--" if r is not after else "-", name) for r, colour, _, name in _models(before, after)
    ]
    for overlay, colour, style, name in ((before.measured, BLACK, "-", "measured"), *simulated):
        if overlay is not None:
            values = np.clip(overlay.residual_mm, -reach, reach)
            weights = np.full(values.size, 100 / max(values.size, 1))
            axes.hist(values, bins=bins, weights=weights, histtype="step", color=colour, ls=style, lw=1.6, label=name)
    axes.set_xlabel("residual under the present model (mm)")
    axes.set_ylabel("edges (%)")
    axes.legend()
    return figure


def overlay_numbers(replays: Sequence[Replay], report: GapReport) -> dict[str, object]:
    """The pictures as plain numbers."""
    measured = replays[0].measured
    limits = {covariate: limits_of(measured, covariate) for covariate in OFTEN}
    reach = 1.1 * float(np.quantile(np.abs(measured.residual_mm), 0.99)) + 1e-6
    bins = np.linspace(-reach, reach, 41)

    def seen(overlay: Overlay | None) -> dict[str, object]:
        if overlay is None:
            return {}
        count = np.histogram(np.clip(overlay.residual_mm, -reach, reach), bins)[0]
        return {
            "residuals": {c: [column.tolist() for column in against(overlay, c, limits[c])] for c in OFTEN},
            "spread": [(0.5 * (bins[1:] + bins[:-1])).tolist(), (100 * count / max(count.sum(), 1)).tolist()],
        }

    models = []
    for k, replay in enumerate(replays):
        edges = []
        for r, run in enumerate(replay.runs):
            d = replay.difference_ms[(replay.run == r) & np.isfinite(replay.difference_ms)]
            if d.size and np.isfinite(_speed(replay, r)):
                edges.append([run.id, _speed(replay, r), *np.quantile(d, [0.5, 0.025, 0.975]).tolist()])
        low, high = replay.rms_ms_ci95
        models.append(
            {
                "name": "" if k == 0 else report.steps[k - 1].effect,
                "edges": edges,
                "latencies": [list(row) for row in replay.latencies_ms()],
                "edge_rms_ms": replay.rms_ms,
                "edge_rms_ms_ci95": [low, high],
                "runs_that_agree": list(replay.runs_that_agree),
                **seen(replay.simulated),
            }
        )
    return {"measured": seen(measured), "models": models}
