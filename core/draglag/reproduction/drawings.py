"""Figures of reproduction, comparisons and tracking response."""

from __future__ import annotations

import base64
import html
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from draglag.curve import CurveFit
from draglag.curve.ranking import Ranked, Ranking
from draglag.drawing import style
from draglag.errors import DataError, cause
from draglag.messages import message
from draglag.model.tracking import TrackingResponse
from draglag.provenance import Source, joint_source
from draglag.report.many_curves import MOST_IN_COLOURS, each_figure, ranked_figure
from draglag.reproduction.measure import Reproduction
from draglag.reproduction.published import RELEASE_TAP_MS
from draglag.system.temporary import new_file

MARKERS = ((style.BLUE, "s"), (style.VERMILION, "o"), (style.GREEN, "^"), (style.PURPLE, "D"), (style.ORANGE, "v"))


def figure_5(result: Reproduction) -> Any:
    """Latency against speed for both screens."""
    figure = style.new_figure()
    axes = figure.add_subplot()
    for row, (colour, marker) in zip(result.table_2, MARKERS, strict=False):
        points = row.curve.points
        if points is not None:
            axes.plot(points.speed_mm_s, 1e3 * points.latency_s, marker, color=colour, label=f"{row.screen}, runs")
        speed = np.geomspace(*row.curve.speed_range_mm_s, 300)
        axes.plot(speed, 1e3 * row.curve.predict_s(speed), color=colour, label=f"{row.screen}, Eq. 5")
    for k, median_ms in enumerate(RELEASE_TAP_MS.values()):
        label = "release taps, the paper's" if k == 0 else None
        axes.axhline(median_ms, color=style.GREY, linestyle=":", linewidth=1, label=label)
    axes.set(xlabel="drag speed, mm/s", ylabel="latency, ms")
    axes.set_ylim(bottom=0)
    axes.legend()
    return figure


def figure_7(result: Reproduction) -> Any:
    """Stylus width by Eq. 3 against speed."""
    figure = style.new_figure(7.2, 3.2)
    axes = figure.add_subplot()
    for row, (colour, marker) in zip(result.table_2, MARKERS, strict=False):
        runs = [run for run in row.analysis.runs if run.stylus_diameter_mm is not None]
        speeds, widths = [run.speed_mm_s for run in runs], [run.stylus_diameter_mm for run in runs]
        axes.plot(speeds, widths, marker, color=colour, label=row.screen)
    axes.axhline(7.0, color=style.BLACK, linestyle="--", label="true width")
    axes.set(xlabel="drag speed, mm/s", ylabel="stylus width, mm", ylim=(5.5, 8.5))
    axes.legend(ncols=2)
    return figure


def figure_8(result: Reproduction, screen: str = "Screen 2") -> Any:
    """Crossing speeds of each validation target on its curve (Fig. 8 b, d, f)."""
    figure = style.new_figure(7.2, 3.4)
    axes = figure.add_subplot()
    cells = [cell for cell in result.table_3 if cell.screen == screen]
    for cell, (colour, _) in zip(cells, MARKERS, strict=False):
        speeds = np.concatenate([run.speeds_mm_s for run in cell.runs])
        label = f"{cell.target} ({cell.reading})" if cell.reading else cell.target
        axes.hist(speeds, bins=np.arange(0, 1100, 25), histtype="step", density=True, color=colour, label=label)
    axes.set(xlabel="speed at the crossing, mm/s", ylabel="share of crossings, per mm/s")
    right = axes.twinx()
    row = next(r for r in result.table_2 if r.screen.startswith(screen))
    speed = np.geomspace(*row.curve.speed_range_mm_s, 300)
    right.plot(speed, 1e3 * row.curve.predict_s(speed), color=style.BLACK)
    right.set_ylabel("latency of the curve, ms")
    right.grid(visible=False)
    axes.legend(loc="upper right")
    return figure


def tracking_figure(responses: Mapping[str, TrackingResponse]) -> Any:
    """Gain and phase at the frequencies of Table 1."""
    figure = style.new_figure(7.2, 4.4)
    upper, lower = figure.subplots(2, 1, sharex=True)
    for (name, response), (colour, marker) in zip(responses.items(), MARKERS, strict=False):
        upper.semilogx(response.frequency_rad_s, response.gain, marker + "-", color=colour, label=name)
        lower.semilogx(response.frequency_rad_s, response.phase_deg, marker + "-", color=colour, label=name)
    style.plain_log_ticks(lower.xaxis)
    upper.set(ylabel="gain", ylim=(0, 1.25))
    lower.set(xlabel="frequency, rad/s", ylabel="phase, °")
    lower.legend()
    return figure


def save_tracking(responses: Mapping[str, TrackingResponse], path: Path, source: Source) -> None:
    """Write gain and phase as .svg or .png. Raises DataError."""
    if path.suffix not in (".svg", ".png"):
        raise DataError(message("{path}: the ending says neither SVG nor PNG", path=path), "Name it .svg or .png")
    if path.exists():
        raise DataError(message("{path}: exists already and is not overwritten", path=path), "Choose another name")
    try:
        with style.house_style():
            figure = tracking_figure(responses)
            style.sign(figure, source)
            with new_file(path) as growing:
                figure.savefig(growing)
    except OSError as error:
        raise DataError(
            message("{path}: cannot be written ({why})", path=path, why=cause(error)), "Check the folder"
        ) from error


def embed(figure: Any) -> str:
    """A figure as a data address."""
    import io

    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()


def comparison_page(curves: Sequence[tuple[str, CurveFit, Source]], order: Ranking | None = None) -> str:
    """A page with all curves and their differences from the first."""
    many = order is not None and len(curves) > MOST_IN_COLOURS
    sources = joint_source([source for _, _, source in curves])
    with style.house_style():
        if order is not None and many:
            figures = [ranked_figure(order), each_figure({name: curve for name, curve, _ in curves}, order)]
        else:
            figures = [_in_colours(curves)]
        for figure in figures:
            style.sign(figure, sources)
        pictures = [embed(figure) for figure in figures]
    lines = [html.escape(f"{name}: {source.line()}") for name, _, source in curves]
    body = "".join(f'<figure><img src="{picture}" alt="Curves and their differences"></figure>' for picture in pictures)
    if order is not None and len(curves) > 2:
        low, high = order.speed_range_mm_s
        head = ["session", "rank", "95 %", f"mean latency, {low:.0f} to {high:.0f} mm/s, ms", "95 %"]
        body += table_html(head, [_place_cells(place) for place in order.places])
    if not many:
        body += table_html(["session", "mm/s", "difference, ms", "95 % band, ms"], _difference_cells(curves))
    body += "<ul>" + "".join(f"<li>{line}</li>" for line in lines) + "</ul>"
    return page("Comparison of latency curves", body)


def _in_colours(curves: Sequence[tuple[str, CurveFit, Source]]) -> Any:
    from draglag.curve.compare import curve_difference

    both = style.new_figure(7.2, 6.4)
    upper, lower = both.subplots(2, 1, sharex=True)
    for (name, curve, source), (colour, _) in zip(curves, MARKERS * 4, strict=False):
        speed = np.geomspace(*curve.speed_range_mm_s, 300)
        upper.plot(speed, 1e3 * curve.predict_s(speed), color=colour, label=name + mark(source))
        upper.fill_between(speed, *(1e3 * v for v in curve.band_s(speed)), color=colour, alpha=0.2, linewidth=0)
    for (name, curve, _), (colour, _) in zip(curves[1:], (MARKERS * 4)[1:], strict=False):
        difference = curve_difference(curves[0][1], curve, np.geomspace(*curve.speed_range_mm_s, 300))
        if difference is not None:
            band = (1e3 * difference.low_s, 1e3 * difference.high_s)
            lower.plot(difference.speed_mm_s, 1e3 * difference.difference_s, color=colour, label=name)
            lower.fill_between(difference.speed_mm_s, *band, color=colour, alpha=0.2, linewidth=0)
    lower.axhline(0, color=style.BLACK, linewidth=0.8)
    upper.set(ylabel="latency, ms")
    lower.set(xlabel="drag speed, mm/s", ylabel=f"minus {curves[0][0]}, ms")
    upper.legend()
    return both


def _difference_cells(curves: Sequence[tuple[str, CurveFit, Source]]) -> list[list[str]]:
    from draglag.curve.compare import curve_difference

    rows = []
    for name, curve, _ in curves[1:]:
        difference = curve_difference(curves[0][1], curve)
        for k in range(0 if difference is None else difference.speed_mm_s.size):
            assert difference is not None
            values = (
                difference.speed_mm_s[k],
                *(1e3 * v[k] for v in (difference.difference_s, difference.low_s, difference.high_s)),
            )
            rows.append([name, "{:.0f}".format(*values), f"{values[1]:.2f}", f"{values[2]:.2f} to {values[3]:.2f}"])
    return rows


def _place_cells(place: Ranked) -> list[str]:
    interval = f"{1e3 * place.low_s:.2f} to {1e3 * place.high_s:.2f}"
    ranks = f"{place.rank_low} to {place.rank_high}"
    return [place.name, str(place.rank), ranks, f"{1e3 * place.mean_s:.2f}", interval]


def mark(source: Source) -> str:
    return " (simulated)" if source.simulated else ""


def table_html(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table with escaped cells."""
    cells = "".join(f"<th>{html.escape(cell)}</th>" for cell in head)
    lines = "".join("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<div class=wide><table><tr>{cells}</tr>{lines}</table></div>"


def page(title: str, body: str) -> str:
    """One self-contained page."""
    css = (
        ":root{color-scheme:light dark}body{font:16px/1.5 system-ui,sans-serif;max-width:62rem;margin:2rem auto;"
        "padding:0 1rem}table{border-collapse:collapse;font-variant-numeric:tabular-nums}th,td{padding:.3rem .7rem;"
        "border-bottom:1px solid #8884;text-align:right}th:first-child,td:first-child{text-align:left}"
        ".wide{overflow-x:auto}" + style.FIGURE_CSS
    )
    return (
        f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>{html.escape(title)}</title>'
        f"<style>{css}</style></head><body><h1>{html.escape(title)}</h1>{body}</body></html>"
    )
