"""The gap report as a self-contained page."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from draglag.drawing.style import FIGURE_CSS, house_style, lay_out, sign, themed
from draglag.errors import DataError, DraglagError, cause
from draglag.gap.provisional import Provisional
from draglag.gap.replaying.replay import Replay, replays
from draglag.gap.results import FLOOR_REACHES, GapReport, Step, stated, unjudged
from draglag.gap.wording import (
    also_in_words,
    check_in_words,
    drift_in_analysis,
    law_in_words,
    noise_in_words,
    separating_run,
    set_in_words,
    sizes_of,
    tolerated_in_words,
    verdict_in_words,
)
from draglag.messages import joined, message
from draglag.provenance import Source, source_of
from draglag.recording import Session
from draglag.report import replayed
from draglag.report.gap_figures import curves, ms_per_mm, residuals, spread, waterfall
from draglag.shown import chance
from draglag.simulation.effects import title_of
from draglag.system.temporary import new_file

_PAGE = """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>
:root{{color-scheme:light dark}}
body{{font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem}}
table{{border-collapse:collapse;width:100%}}th,td{{text-align:left;padding:.35rem .6rem;border-bottom:1px solid #8886}}
.verdict{{font-size:1.3rem;font-weight:600}}
.number{{white-space:nowrap}}.narrow{{width:auto;min-width:60%}}
.track{{display:block;height:.75em;background:#8883;border-radius:2px}}
.bar{{display:block;height:100%;min-width:1px;background:#0072b2;border-radius:2px}}
@media screen and (prefers-color-scheme:dark){{.bar{{background:#56a9e8}}}}
{css}</style></head><body>{body}</body></html>"""

LEAST_SHOWN = 0.005
"""Least joint probability of all other explanations that gets a row; less would print as 0.00."""
_WHOLE = re.compile(r"\bp (?:=|&lt;) [\d.e-]*\d|[\d.]*\d (?:%|(?:mm/s|mm|ms|ppm|Hz|s)\b)")


def write_gap_report(
    session: Session,
    report: GapReport,
    path: Path,
    progress: Callable[[float, str], None] | None = None,
    provisional: Provisional | None = None,
) -> Path:
    """The path of the page.

    Raises DataError if the report has no verdict or the folder cannot be written.
    """
    if report.first is None or report.last is None:
        raise DataError(
            "there is no verdict to report",
            message("Record what is missing: {missing}", missing=joined("; ", report.missing)),
        )
    with _write_errors_named(path):  # before the work
        path.parent.mkdir(parents=True, exist_ok=True)
    again, unsimulated = _simulated(session, report, progress)
    source = source_of(session)
    body = [f"<h1>Gap between simulation and measurement: {escape(report.session)}</h1>"]
    body.append(f"<p>{escape(source.line())} · stylus {session.stylus.diameter_mm:g} mm</p>")
    body += _said(session, report)
    body.append(_table(report))
    if provisional is not None:
        body.append(f"<p>{escape(provisional.words())}</p>")
    for words in (tolerated_in_words(report), noise_in_words(report)):
        body += [f"<p>{escape(words)}</p>"] if words else []
    body.append(_explanations(report))
    body.append(_check_table(report))
    body.append(_replay_table(again, report) if again else f"<p>{escape(unsimulated)}</p>")
    body = list(map(_unbroken, body))
    with house_style():
        figures = _figures(again, report, provisional)
    for figure, caption in figures:
        body.append(f"<figure>{_svg(figure, source)}<figcaption>{_unbroken(escape(caption))}</figcaption></figure>")
    if report.not_seen:
        items = "".join(f"<li><b>{escape(title_of(k))}</b>: {escape(v)}</li>" for k, v in report.not_seen.items())
        body.append(f"<h2>What this session could not have shown</h2><ul>{_unbroken(items)}</ul>")
    title = f"{'SIMULATED – ' if source.simulated else ''}draglag gap report"
    with _write_errors_named(path), new_file(path, replace=True) as growing:
        growing.write_text(_PAGE.format(title=title, css=FIGURE_CSS, body="".join(body)), "utf-8")
    return path


@contextmanager
def _write_errors_named(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as problem:
        raise DataError(
            message("{path}: cannot be written ({why})", path=path, why=cause(problem)),
            "Choose a folder that can be written to",
        ) from None


def _unbroken(html: str) -> str:
    """The same HTML; a number stays in one line with its unit, and a p-value."""
    return _WHOLE.sub(r'<span class="number">\g<0></span>', html)


def _check_table(report: GapReport) -> str:
    if not report.check:
        return ""
    rows = "".join(
        f"<tr><td>{escape(one.name)}, {escape(one.unit)}</td><td>{one.measured:.3g}</td><td>{one.simulated:.3g}</td>"
        f"<td>{'✓ agrees' if one.agrees else '▲ disagrees'}</td></tr>"
        for one in report.check
    )
    words = f"<p>{escape(found)}</p>" if (found := check_in_words(report)) else ""
    head = "<tr><th>statistic</th><th>measured</th><th>simulated</th><th></th></tr>"
    return f"<h2>Simulated again with the final model</h2><table>{head}{rows}</table>{words}"


def _said(session: Session, report: GapReport) -> list[str]:
    assert report.last is not None
    body = [f'<p class="verdict">{escape(verdict_in_words(report))}</p>']
    body += [f"<p>{escape(words)}</p>" for words in (law_in_words(report.law), also_in_words(report)) if words]
    ms = ms_per_mm(report.last)
    first_mm, last_mm = report.gap_first_mm or 0.0, report.gap_last_mm or 0.0
    floor_mm = report.noise_floor_mm or 0.0
    counted = np.count_nonzero(report.last.counted)
    more = np.count_nonzero(report.last.use) - counted
    unsure = f", {more} more are near a switch or an end of a trace" if more else ""
    body.append(
        f"<p>Held-out gap {first_mm:.3f} → {last_mm:.3f} mm ({ms * first_mm:.2f} → {ms * last_mm:.2f} ms); noise floor "
        f"{floor_mm:.3f} mm ({ms * floor_mm:.2f} ms; {FLOOR_REACHES}); {counted} edges of "
        f"{np.unique(report.last.run_index).size} runs{unsure}{_left_out(report)}. "
        f"{escape(unjudged(session, report))}</p>"
    )
    if drift := drift_in_analysis(session, report):
        body.append(f"<p>{escape(drift)}</p>")
    return body


def _figures(again: tuple[Replay, ...], report: GapReport, provisional: Provisional | None) -> list[tuple[Any, str]]:
    assert report.first is not None
    assert report.last is not None
    before = ", before (orange triangles) and after (blue dots)" if report.first is not report.last else ""
    nearest = "; dotted: the Eq. 5 nearest to it" if not report.law.adequate else ""
    return [
        (
            waterfall(report, provisional),
            "RMS residual on runs held out of the fit, step by step, against the noise floor: in mm across the "
            "beam, and as the time the stylus takes for it at the session's RMS velocity across the beam. "
            "Provisional (hatched, ~): an effect less probable than not, or a term without a name.",
        ),
        *_overlays(again, report),
        (
            residuals(report.first, report.last),
            "Residuals against what they could follow: the latency that fits the edges of each bin best, with its "
            f"95 % interval{before}. A flat line at zero is a closed gap.",
        ),
        (curves(report), f"Latency law with the latency of each run{nearest}."),
        (
            spread(report.first, report.last),
            "Distribution of the residuals; the line is what noise alone predicts. The bins at both ends hold all "
            "that lies beyond.",
        ),
    ]


def _left_out(report: GapReport) -> str:
    if report.first is None or report.last is None or report.first.use.size != report.last.use.size:
        return ""
    lost = np.count_nonzero(report.first.use & ~report.last.use)
    return f"; {lost} more, which the fit without effects used, are left out" if lost else ""


def _table(report: GapReport) -> str:
    if not report.steps:
        return "<p>No effect was added.</p>"
    rows = []
    for step in report.steps:
        sizes = "<br>".join(map(escape, sizes_of(step)))
        alike = "".join(f"<br><small>or {escape(title_of(also))}</small>" for also in step.indistinguishable_from)
        small = "".join(f"<br><small>{escape(words)}</small>" for words in _small_print(step) if words)
        rows.append(
            f"<tr><td><b>{escape(title_of(step.effect))}</b>{alike}</td><td>{escape(stated(step.probability))}</td>"
            f"<td>{escape(step.where)}{small}</td><td>{sizes}</td>"
            f'<td class="number">{step.gap_before_mm:.3f} → {step.gap_after_mm:.3f}</td></tr>'
        )
    head = "<tr><th>effect</th><th>probability</th><th>where</th><th>size (95 %)</th><th>gap, mm</th></tr>"
    return f"<table>{head}{''.join(rows)}</table>"


def _small_print(step: Step) -> tuple[str, str]:
    run = separating_run(step.effect, step.indistinguishable_from, step.extra_run)
    return (
        f"{step.evidence}; {chance(step.p_value)}",
        f"to separate them: {run}" if step.indistinguishable_from and run else "",
    )


def _explanations(report: GapReport) -> str:
    if not report.explanations:
        return ""
    known = [(set_in_words(names), p) for names, p in report.explanations]
    rest = 1 - sum(p for _, p in known)
    if rest >= LEAST_SHOWN:
        known.append(("all others together", rest))
    rows = "".join(
        f'<tr><td>{escape(words)}</td><td class="number">{escape(stated(p))}</td>'
        f'<td style="width:50%"><span class="track"><span class="bar" style="width:{100 * p:.1f}%"></span></span></td>'
        "</tr>"
        for words, p in known
    )
    return (
        f'<h2>Explanations compared</h2><table class="narrow"><tr><th>effects</th><th>probability</th><th></th></tr>'
        f"{rows}</table><p><small>Sets of effects, each fitted jointly and weighed by its prior and its marginal "
        "likelihood on the same edges. What the touch and laser streams show by themselves is repaired before and is "
        "not part of these sets.</small></p>"
    )


def _svg(figure: Any, source: Source) -> str:
    sign(figure, source)
    lay_out(figure)
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg")
    text = buffer.getvalue()
    return themed(text[text.index("<svg") :])


def _simulated(
    session: Session, report: GapReport, progress: Callable[[float, str], None] | None
) -> tuple[tuple[Replay, ...], str]:
    try:
        return replays(session, report, progress), ""
    except (DraglagError, ValueError, np.linalg.LinAlgError) as problem:
        return (), f"The session could not be simulated again: {problem}"


def _overlays(again: tuple[Replay, ...], report: GapReport) -> list[tuple[Any, str]]:
    if not again:
        return []
    first, last = again[0], again[-1]
    out = [
        (
            replayed.edges_figure(first, last),
            "The session simulated again with the measured motion of the hand. Above: light on the sensor in the run "
            "that the present model misses most; dotted lines are the measured edges. Below: simulated less measured "
            "edge times of each run, median and central 95 %.",
        ),
        (
            replayed.latencies_figure(first, last),
            "Latency of every run, measured and simulated, by the same estimator, with 95 % intervals.",
        ),
        (
            replayed.residuals_figure(first, last),
            "Residuals as the present model sees them: the latency that fits the edges of each bin best, with its 95 % "
            "band. Where the simulation holds the cause, it shows the measured structure (dots on squares).",
        ),
        (
            replayed.spread_figure(first, last),
            "Distribution of these residuals, measured and simulated with noise. Simulated ones are the narrower where "
            "nothing else is left: touch noise that lasts longer than a frame passes for motion of the hand.",
        ),
    ]
    steps = replayed.steps_figure(again, report)
    if steps is not None:
        caption = (
            "Each step on its own: what was measured, and the simulation without and with the effect (95 % bands)."
        )
        out.insert(2, (steps, caption))
    return out


def _replay_table(again: tuple[Replay, ...], report: GapReport) -> str:
    rows = []
    for k, one in enumerate(again):
        low, high = one.rms_ms_ci95
        inside, of = one.runs_that_agree
        name = "present model" if k == 0 else f"+ {title_of(report.steps[k - 1].effect)}"
        rows.append(
            f"<tr><td>{escape(name)}</td><td>{one.rms_mm:.3f}</td>"
            f'<td class="number">{one.rms_ms:.2f} ({low:.2f} to {high:.2f})</td><td>{inside} of {of}</td></tr>'
        )
    head = (
        "<tr><th>simulated again with</th><th>edges off by, mm RMS</th><th>ms RMS (95&nbsp;%)</th>"
        "<th>runs whose latency agrees within the 95 % interval of the difference</th></tr>"
    )
    return (
        f"<h2>Simulated against measured</h2><table>{head}{''.join(rows)}</table>"
        "<p><small>Here the model is fitted to all runs and follows the hand of each; the held-out gap above judges "
        "runs by a fit without them, but for the slowest and the fastest where they were run once: those are in every "
        "fit, and not in the gap.</small></p>"
    )
