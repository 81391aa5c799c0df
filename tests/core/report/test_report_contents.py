"""What a report says of its session: details, notes with time and run, the reference; widths of figures for papers."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from html import unescape
from pathlib import Path

import pytest

import draglag
from draglag.analysis import AnalysisOptions, analyze
from draglag.exchange import read_exchange
from draglag.latency.flags import MEANING
from draglag.recording import LogEntry, Session
from draglag.report import write_report
from draglag.report.journal import WIDTHS_MM, write_journal_figures

SAMPLE = Path(__file__).parents[2] / "data" / "exchange" / "none-A"
DETAILS = {
    "participant": "P07", "session": "second", "operator": "Zoë <lab>", "dominant_hand": "left & right",
}  # fmt: skip
MM_PER_PT = 25.4 / 72
STARTED_S = 1000.0


@pytest.fixture(scope="module")
def session() -> Session:
    """Three circles; the operator wrote notes before and in runs, of which one was kept out of the curve."""
    whole = read_exchange(SAMPLE)
    first, second, third = (whole.run(run_id) for run_id in ("run-03", "run-04", "run-10"))
    said = (
        LogEntry(STARTED_S + 3725.4, "note", "operator", "changed the tip"),
        LogEntry(STARTED_S + 3700.0, "warning", "touch", "events were lost"),
        LogEntry(STARTED_S + 3690.0, "info", "touch", "complete"),
    )
    notes = (LogEntry(STARTED_S + 65.0, "note", "operator", "lamp <b>off</b>"),)
    runs = (first, replace(second, log=said), third)
    return replace(whole, runs=runs, notes=notes, details=DETAILS, started_s=STARTED_S)


@pytest.fixture(scope="module")
def page(session: Session, tmp_path_factory: pytest.TempPathFactory) -> str:
    options = AnalysisOptions(form="constant", exclude={"run-10": "the stylus was lifted"})
    return write_report(session, analyze(session, options), tmp_path_factory.mktemp("report")).read_text("utf-8")


def texts(page: str, element: str) -> list[str]:
    """What is read in each element of that name."""
    found = re.findall(rf"<{element}\b[^>]*>(.*?)</{element}>", page, re.DOTALL)
    return [" ".join(unescape(re.sub(r"<[^>]*>", "", inner)).split()) for inner in found]


def test_a_corrected_diameter_stands_with_the_recorded_one(session: Session, page: str, tmp_path: Path) -> None:
    assert "7.00 mm" in texts(page, "dd")
    options = AnalysisOptions(form="constant", stylus_mm=6.8)
    corrected = write_report(session, analyze(session, options), tmp_path).read_text("utf-8")
    assert "6.80 mm, corrected: recorded as 7.00 mm" in texts(corrected, "dd")


def test_notes_stand_with_time_and_run_in_order_of_time(page: str) -> None:
    assert texts(page, "li") == [
        "⚠ run-10 not in the curve (the stylus was lifted)",
        "+1:05 lamp <b>off</b>",
        "⚠ +61:40 run-04 events were lost",
        "+62:05 run-04 changed the tip",
    ]


def test_details_of_the_session_are_listed(page: str, session: Session) -> None:
    listed = dict(zip(texts(page, "dt"), texts(page, "dd"), strict=True))
    assert {name: listed[name] for name in ("Participant", "Session", "Operator", "Dominant hand")} == {
        "Participant": "P07", "Session": "second", "Operator": "Zoë <lab>", "Dominant hand": "left & right",
    }  # fmt: skip
    screen = session.screen
    assert texts(page, "h1") == [f"Drag latency of {screen.name}"]
    size = f"{screen.width_mm:.1f} × {screen.height_mm:.1f} mm, {screen.width_px} × {screen.height_px} pixels"
    assert listed["Screen"] == size


def test_the_reference_is_there_to_copy_and_names_the_version(page: str) -> None:
    assert "How to cite" in texts(page, "h2")
    (reference,) = re.findall(r'<p class="cite">(.*?)</p>', page)
    assert reference.startswith("The draglag authors. draglag: ")
    assert reference.endswith(f"Software, version {draglag.__version__}.")


def test_figures_for_a_paper_are_as_wide_as_their_names_say(session: Session, tmp_path: Path) -> None:
    analysis = analyze(session, AnalysisOptions(form="constant"))
    written = write_journal_figures(session, analysis, tmp_path / "figures")
    widths = {"pdf": set[float](), "svg": set[float]()}
    for path in written:
        (named_mm,) = re.findall(r"-(\d+)mm\.", path.name)
        kind = path.suffix[1:]
        wide_mm = pdf_width_mm(path) if kind == "pdf" else svg_width_mm(path)
        assert wide_mm == pytest.approx(float(named_mm), abs=0.01), path.name
        widths[kind].add(round(wide_mm, 1))
    assert widths["pdf"] == widths["svg"] == set(WIDTHS_MM.values())


def pdf_width_mm(path: Path) -> float:
    """Of the only page."""
    (box,) = re.findall(rb"/MediaBox \[([^\]]*)\]", path.read_bytes())
    left, _, right, _ = (float(number) for number in box.split())
    return (right - left) * MM_PER_PT


def svg_width_mm(path: Path) -> float:
    """As programs that take it in read it; its coordinates are points."""
    drawing = ET.parse(path).getroot()
    left, _, wide, _ = (float(number) for number in drawing.attrib["viewBox"].split())
    assert left == 0
    named_pt = float(drawing.attrib["width"].removesuffix("pt"))
    assert named_pt == wide
    return named_pt * MM_PER_PT


def test_every_flag_is_explained_once_below_its_table(session: Session, tmp_path: Path) -> None:
    found = analyze(session, AnalysisOptions(form="constant"))
    mine = ("alias", "uneven_trace"), ("uneven_trace", "of_another_package"), ()
    flagged = tuple(replace(run, flags=flags) for run, flags in zip(found.runs, mine, strict=True))
    page = write_report(session, replace(found, runs=flagged), tmp_path).read_text("utf-8")
    runs = page[page.index("<h2>Runs") : page.index("<h2>Alignment")]
    legend = list(zip(texts(runs, "dt"), texts(runs, "dd"), strict=True))
    assert legend == [("alias", MEANING["alias"]), ("uneven trace", MEANING["uneven_trace"])]
    assert runs.index("<dl") > runs.index("</table>")


def test_the_headline_states_each_latency_with_its_interval(session: Session, tmp_path: Path) -> None:
    found = analyze(session, AnalysisOptions(form="constant"))
    known = [run for run in found.runs if run.latency_ci95_ms is not None and run.speed_mm_s is not None]
    assert len(known) == 3
    (said,) = re.findall(r'<p class="verdict">(.*?)</p>', write_report(session, found, tmp_path / "a").read_text())
    for pick in (min, max):
        run = pick(known, key=lambda run: run.speed_mm_s or 0.0)
        low_ms, high_ms = run.latency_ci95_ms or (0.0, 0.0)
        assert low_ms < high_ms
        assert f"{run.latency_ms:.2f} ms ({low_ms:.2f} to {high_ms:.2f}) at {run.speed_mm_s:.0f} mm/s" in said
    assert said.count("95 % intervals") == 1
    bare = replace(found, runs=tuple(replace(run, latency_ci95_s=None) for run in found.runs))
    (said,) = re.findall(r'<p class="verdict">(.*?)</p>', write_report(session, bare, tmp_path / "b").read_text())
    assert said.count("(no interval)") == 2
    assert "95 %" not in said
