"""A report of one session, self-contained, and its figures."""

from __future__ import annotations

import base64
import os
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import draglag
from draglag.analysis import Analysis
from draglag.curve import FORMS, CurveFit
from draglag.curve.symbols import symbol_html
from draglag.drawing import style
from draglag.errors import DataError, cause
from draglag.latency import RunEstimate
from draglag.latency.flags import meanings
from draglag.messages import message
from draglag.provenance import source_of
from draglag.recording import Session
from draglag.report import figures
from draglag.report.notes import citation, note_rows
from draglag.shown import matched
from draglag.store.schema import slug
from draglag.system.temporary import publish, temporary_for
from draglag.validation.misalignment import Validation


@dataclass(frozen=True)
class Figure:
    name: str
    caption: str
    image: str  # data: address
    alt: str


def write_report(session: Session, analysis: Analysis, out_dir: Path | str) -> Path:
    """The page ``report.html``, with ``figures/*.svg|png`` next to it.

    Raises DataError if the report exists or cannot be written.
    """
    out = Path(out_dir)
    report = out / "report.html"
    if report.exists():
        raise DataError(message("{path}: exists already and is not overwritten", path=report), "Choose another folder")
    try:
        with style.house_style():
            out.mkdir(parents=True, exist_ok=True)
            with temporary_for(report) as growing:
                drawn = growing.with_name("figures")
                drawn.mkdir()
                pictures = {name: list(group) for name, group in _figures(session, analysis, drawn).items()}
                growing.write_text(_page(session, analysis, pictures), "utf-8")
                (out / "figures").mkdir(exist_ok=True)
                for picture in drawn.iterdir():
                    os.replace(picture, out / "figures" / picture.name)
                publish(growing, report)
    except OSError as error:
        raise DataError(
            message("{path}: cannot be written ({why})", path=out, why=cause(error)), "Check the folder and free space"
        ) from error
    return report


def _figures(session: Session, analysis: Analysis, folder: Path) -> dict[str, Iterator[Figure]]:
    return {
        "curve": _main_figures(session, analysis, folder),
        "runs": _run_figures(session, analysis, folder),
        "validation": _validation_figures(session, analysis, folder),
    }


def _main_figures(session: Session, analysis: Analysis, folder: Path) -> Iterator[Figure]:
    yield _keep(
        session,
        figures.latency_figure(analysis),
        folder,
        "latency",
        "Latency against drag speed. Every mark is one run, its bar the 95 % interval; tap latency is what an "
        "infinitely fast drag should approach.",
    )
    if any(run.stylus_diameter_mm is not None for run in analysis.runs):
        yield _keep(
            session,
            figures.width_figure(analysis, session),
            folder,
            "stylus-width",
            "Width of the stylus from the distance of the two lines: right only where the alignment is.",
        )
    if analysis.taps:
        yield _keep(
            session,
            figures.taps_figure(analysis),
            folder,
            "taps",
            "Tap latency: box from quartile to quartile, line = median.",
        )


def _run_figures(session: Session, analysis: Analysis, folder: Path) -> Iterator[Figure]:
    for estimate in sorted(analysis.runs, key=lambda run: run.speed_mm_s or 0.0):
        if estimate.alignment is None or estimate.latency_ms is None:
            continue
        title = f"{estimate.id}: {estimate.speed_mm_s:.0f} mm/s, latency {estimate.latency_ms:.1f} ms"
        drawn = figures.alignment_figure(session.run(estimate.id), estimate.alignment, title, session)
        yield _keep(session, drawn, folder, f"alignment-{slug(estimate.id)}", title, png=True)


def _validation_figures(session: Session, analysis: Analysis, folder: Path) -> Iterator[Figure]:
    if analysis.validation and analysis.curve is not None:
        caption = "Speeds at which the validation runs cross the beam, on the curve that corrects them."
        yield _keep(session, figures.speeds_figure(analysis), folder, "validation-speeds", caption)
    for item in analysis.validation:
        title = f"{item.run}, {item.protocol}: {item.delta_j_percent:.2f} % of the misalignment removed"
        drawn = figures.alignment_figure(session.run(item.run), item.alignment, title, session)
        yield _keep(session, drawn, folder, f"alignment-{slug(item.run)}", title, png=True)


def _keep(session: Session, drawn: Any, folder: Path, name: str, caption: str, png: bool = False) -> Figure:
    """A saved, embedded figure: PNG where thousands of points would slow the page."""
    svg = style.save(drawn, folder, name, source_of(session))
    if png:
        image = "data:image/png;base64," + base64.b64encode((folder / f"{name}.png").read_bytes()).decode()
    else:
        image = "data:image/svg+xml;base64," + base64.b64encode(style.themed(svg).encode()).decode()
    return Figure(name, caption, image, re.sub(r"\s+", " ", caption))


def _page(session: Session, analysis: Analysis, pictures: dict[str, list[Figure]]) -> str:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("draglag.report", "templates"), autoescape=True, undefined=StrictUndefined
    )
    environment.filters["number"] = _number
    environment.filters["moment"] = _moment
    environment.filters["form_title"] = lambda form: FORMS[form].title if form in FORMS else form.replace("_", " ")
    result = analysis.to_dict()
    return environment.get_template("report.html").render(
        session=session,
        analysis=analysis,
        result=result,
        runs=sorted(analysis.runs, key=lambda run: run.speed_mm_s or 0.0),
        pictures=pictures,
        flags={"runs": _meanings(analysis.runs), "validation": _meanings(analysis.validation)},
        notes=note_rows(session, analysis),
        citation=citation(),
        version=draglag.__version__,
        source=source_of(session),
        verdict=_verdict(analysis),
        coefficients=_coefficients(analysis.curve),
    )


def _meanings(rows: Iterable[RunEstimate | Validation]) -> dict[str, str]:
    return meanings(flag for row in rows for flag in row.flags)


def _coefficients(curve: CurveFit | None) -> list[tuple[Any, str, Any]]:
    from markupsafe import Markup, escape

    if curve is None:
        return []
    half = curve.half_intervals
    values = sorted(curve.parameters.items())
    named = [(symbol_html(str(escape(name))), matched(value, half[name])) for name, value in values]
    return [(Markup(symbol), value, unit) for (symbol, unit), value in named]


def _verdict(analysis: Analysis) -> str:
    known = [
        run
        for run in analysis.runs
        if run.latency_ms is not None and run.speed_mm_s is not None and run.id not in analysis.excluded
    ]
    if not known:
        return "No run gave a latency."
    slow, fast = (pick(known, key=lambda run: run.speed_mm_s or 0.0) for pick in (min, max))
    sentence = f"Latency {_with_interval(slow)}"
    if fast is not slow:
        sentence += f" and {_with_interval(fast)}"
    if any(run.latency_ci95_ms is not None for run in (slow, fast)):
        sentence += ", with 95 % intervals of random and systematic errors together"
    if analysis.curve is not None:
        sentence += (
            f"; the curve fits {analysis.curve.n_points} runs with an RMS of {1e3 * analysis.curve.rms_s:.2f} ms"
        )
    return sentence + "."


def _with_interval(run: RunEstimate) -> str:
    interval = "no interval" if run.latency_ci95_ms is None else "{:.2f} to {:.2f}".format(*run.latency_ci95_ms)
    return f"{run.latency_ms:.2f} ms ({interval}) at {run.speed_mm_s:.0f} mm/s"


def _number(value: object, digits: int = 1) -> str:
    return "–" if not isinstance(value, int | float) or value != value else f"{value:.{digits}f}"


def _moment(text: str) -> str:
    try:
        return f"{datetime.fromisoformat(text).astimezone(UTC):%Y-%m-%d %H:%M} UTC"
    except ValueError:
        return text
