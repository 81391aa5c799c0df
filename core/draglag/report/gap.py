"""The gap report: verdict, steps, and pictures of the residuals before and after, as one self-contained page."""

from __future__ import annotations

import io
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from draglag.errors import DataError
from draglag.gap.fit import Fit
from draglag.gap.heldout import held_out_residual_mm
from draglag.gap.workflow import GapReport
from draglag.recording import FloatArray, Session
from draglag.report.style import BLUE, GREEN, GREY, ORANGE, VERMILION, house_style, new_figure

_PAGE = """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>
:root{{color-scheme:light dark}}
body{{font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem}}
table{{border-collapse:collapse;width:100%}}th,td{{text-align:left;padding:.35rem .6rem;border-bottom:1px solid #8886}}
.verdict{{font-size:1.3rem;font-weight:600}}
figure{{margin:1.5rem 0;background:#fff;color:#222;padding:.6rem;border-radius:6px}}
figcaption{{font-size:.9rem}}svg{{display:block;margin:0 auto;max-width:100%;height:auto}}
</style></head><body>{body}</body></html>"""

_WORDS = {
    "no_gap": "No gap: what is left is noise.",
    "explained": "Explained: with the effects below only noise is left.",
    "unexplained": "Unexplained: a gap remains that follows {covariate} and has no name in the library.",
}
_BINS = 12


def write_gap_report(session: Session, report: GapReport, path: Path) -> Path:
    """Write the page. Raises DataError when the report has no verdict or the folder cannot be written."""
    if report.first is None or report.last is None:
        raise DataError("there is no verdict to report", "Record what is missing: " + "; ".join(report.missing))
    with house_style():
        figures = [
            (_waterfall(report), "RMS residual on runs held out of the fit, step by step, against the noise floor."),
            (
                _residuals(report.first, report.last),
                "Residual of every edge against what it could follow: mean of each bin with its 95 % interval, "
                "before (orange triangles) and after (blue dots). A flat line at zero is a closed gap.",
            ),
            (_curves(report), "Latency law before and after, with the latency of each run."),
            (
                _spread(report.first, report.last),
                "Distribution of the residuals; the line is what noise alone predicts.",
            ),
        ]
    body = [f"<h1>Gap between simulation and measurement: {escape(report.session)}</h1>"]
    body.append(f'<p class="verdict">{_WORDS[report.verdict or "no_gap"].format(covariate=report.unexplained_by)}</p>')
    body.append(
        f"<p>Held-out gap {report.gap_first_mm:.3f} → {report.gap_last_mm:.3f} mm; noise floor "
        f"{report.noise_floor_mm:.3f} mm; {report.last.residual_mm.size} edges of {len(report.last.runs)} runs.</p>"
    )
    body.append(_table(report))
    for figure, caption in figures:
        body.append(f"<figure>{_svg(figure)}<figcaption>{escape(caption)}</figcaption></figure>")
    if report.not_seen:
        items = "".join(f"<li><b>{escape(k)}</b>: {escape(v)}</li>" for k, v in report.not_seen.items())
        body.append(f"<h2>What this session could not have shown</h2><ul>{items}</ul>")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(_PAGE.format(title="draglag gap report", body="".join(body)), encoding="utf-8")
    except OSError as problem:
        raise DataError(f"{path}: {problem.strerror}", "Choose a folder that can be written to") from None
    return path


def _table(report: GapReport) -> str:
    if not report.steps:
        return "<p>No effect was added.</p>"
    rows = []
    for step in report.steps:
        sizes = "<br>".join(
            f"{escape(name)} = {value:.4g} ({low:.4g} to {high:.4g})"
            for name, (value, (low, high)) in step.parameters.items()
        )
        also = (
            f"<br><small>or {escape(', '.join(step.indistinguishable_from))}</small>"
            if step.indistinguishable_from
            else ""
        )
        extra = f"<br><small>{escape(step.extra_run)}</small>" if step.extra_run else ""
        rows.append(
            f"<tr><td><b>{escape(step.effect)}</b>{also}</td><td>{escape(step.where)}{extra}</td><td>{sizes}</td>"
            f"<td>{step.gap_before_mm:.3f} → {step.gap_after_mm:.3f}</td><td>{step.p_value:.1g}</td></tr>"
        )
    head = "<tr><th>effect</th><th>where</th><th>size (95 %)</th><th>gap, mm</th><th>p</th></tr>"
    return f"<table>{head}{''.join(rows)}</table>"


def _svg(figure: Any) -> str:
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg")
    text = buffer.getvalue()
    return text[text.index("<svg") :]


def _waterfall(report: GapReport) -> Any:
    figure = new_figure(7.2, 3.2)
    axes = figure.add_subplot()
    names = ["present model", *(f"+ {s.effect.replace('_', ' ')}" for s in report.steps)]
    values = [report.gap_first_mm or 0.0, *(s.gap_after_mm for s in report.steps)]
    places = np.arange(len(names))
    axes.bar(places, values, width=0.55, color=[ORANGE] + [BLUE] * len(report.steps))
    for place, value in zip(places, values, strict=True):
        axes.annotate(
            f"{value:.3f}", (place, value), ha="center", va="bottom", xytext=(0, 2), textcoords="offset points"
        )
    axes.axhline(report.noise_floor_mm or 0.0, color=GREEN, linestyle="--", label="noise floor")
    axes.set_xticks(places, names)
    axes.set_xlim(-0.6, max(len(names), 2) - 0.4)
    axes.set_ylim(0, 1.2 * max([*values, report.noise_floor_mm or 0.0]))
    axes.set_ylabel("held-out gap (mm RMS)")
    axes.legend(loc="upper right")
    return figure


def _residuals(first: Fit, last: Fit) -> Any:
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
        for fit, colour, marker, name in ((first, ORANGE, "^", "before"), (last, BLUE, "o", "after")):
            # As latency: a residual across the beam over the velocity across it keeps its sign in both directions.
            late_ms = 1e3 * fit.residual_mm / np.where(np.abs(fit.view.v_across) < 1, np.nan, fit.view.v_across)
            middle, mean, reach = _binned(getattr(fit.view, covariate), late_ms)
            axes.errorbar(
                middle, mean, reach, color=colour, marker=marker, linestyle="-", lw=0.8, capsize=2, label=name
            )
        axes.axhline(0, color=GREY, lw=0.8)
        axes.set_xlabel(title)
        axes.set_ylabel("residual (ms)")
    grid[0, 0].set_xscale("log")
    grid[0, 0].legend(loc="best")
    return figure


def _binned(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    limits = np.unique(np.quantile(x, np.linspace(0, 1, _BINS + 1)))
    which = np.clip(np.searchsorted(limits, x, side="right") - 1, 0, max(limits.size - 2, 0))
    rows = []
    for k in range(max(limits.size - 1, 1)):
        own = y[(which == k) & np.isfinite(y)]
        if own.size > 3:
            rows.append(
                (float(np.median(x[which == k])), float(own.mean()), 1.96 * float(own.std()) / np.sqrt(own.size))
            )
    table = np.array(rows).reshape(-1, 3)
    return table[:, 0], table[:, 1], table[:, 2]


def _curves(report: GapReport) -> Any:
    figure = new_figure(7.2, 3.8)
    axes = figure.add_subplot()
    assert report.first is not None
    assert report.last is not None
    speed = np.geomspace(max(float(report.last.view.speed.min()), 20.0), float(report.last.view.speed.max()), 300)
    axes.plot(speed, 1e3 * report.first.law(speed), color=ORANGE, linestyle="--", label="before")
    axes.plot(speed, 1e3 * report.last.law(speed), color=BLUE, label="after")
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


def _spread(first: Fit, last: Fit) -> Any:
    figure = new_figure(7.2, 3.2)
    axes = figure.add_subplot()
    _, variance = held_out_residual_mm(last)
    reach = 4 * float(np.sqrt(np.mean(variance))) + 1e-6
    bins = np.linspace(-reach, reach, 61).tolist()
    for fit, colour, name in ((first, ORANGE, "before"), (last, BLUE, "after")):
        axes.hist(np.clip(fit.residual_mm, -reach, reach), bins=bins, histtype="step", color=colour, lw=1.6, label=name)
    x = np.linspace(-reach, reach, 300)
    density = np.mean(
        np.exp(-0.5 * x[:, None] ** 2 / variance[None, :]) / np.sqrt(2 * np.pi * variance[None, :]), axis=1
    )
    axes.plot(
        x, density * last.residual_mm.size * (bins[1] - bins[0]), color=GREEN, linestyle="--", label="noise alone"
    )
    axes.set_xlabel("residual (mm)")
    axes.set_ylabel("edges")
    axes.legend()
    return figure
