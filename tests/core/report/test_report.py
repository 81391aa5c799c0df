"""The report holds what was estimated, needs no other file and overwrites nothing."""

from __future__ import annotations

import base64
import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest

from core.store_sessions import bare_session
from draglag.analysis import Analysis, AnalysisOptions, analyze
from draglag.drawing import style
from draglag.errors import DataError
from draglag.exchange import read_exchange
from draglag.recording import LogEntry, Run, Session, empty_laser, empty_touch
from draglag.report import figures, write_report
from draglag.report.journal import write_journal_figures

SAMPLE = Path(__file__).parents[2] / "data" / "exchange" / "none-A"


@pytest.fixture(scope="module")
def measured() -> tuple[Session, Analysis]:
    """Three circles and the chirp of a sample."""
    whole = read_exchange(SAMPLE)
    kept = tuple(whole.run(run_id) for run_id in ("run-03", "run-04", "run-10", "run-14"))
    session = replace(whole, name="A <b>&", runs=kept, notes=(LogEntry(0.0, "note", "operator", "wiped & dried"),))
    return session, analyze(session, AnalysisOptions(form="constant"))


@pytest.fixture(scope="module")
def written(measured: tuple[Session, Analysis], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its report, in a folder that is only read."""
    return write_report(*measured, tmp_path_factory.mktemp("written"))


class Page(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.text: list[str] = []
        self.sources: list[str] = []
        self.opened: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in ("meta", "img", "br"):
            self.opened.append(tag)
        self.sources += [value or "" for key, value in attrs if key in ("src", "href")]

    def handle_endtag(self, tag: str) -> None:
        assert self.opened.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)


def read_page(path: Path) -> Page:
    page = Page()
    page.feed(path.read_text("utf-8"))
    assert page.opened == []
    return page


def test_the_page_shows_every_estimate_and_is_whole_in_one_file(
    written: Path, measured: tuple[Session, Analysis]
) -> None:
    analysis = measured[1]
    page = read_page(written)
    text = " ".join(page.text)
    for run in analysis.runs:
        assert run.id in text
        assert f"{run.latency_ms:.2f}" in text
    assert f"{analysis.validation[0].delta_j_percent:.2f}" in text
    assert "A <b>&" in text
    assert "wiped & dried" in text
    # latency, width, taps, speeds, three runs, one chirp
    assert len(page.sources) == 8
    assert all(source.startswith("data:image/") for source in page.sources)


def test_the_page_names_screen_and_details_of_the_session(tmp_path: Path, measured: tuple[Session, Analysis]) -> None:
    session, analysis = measured
    details = {"participant": "P07", "session": "morning 2", "operator": "Zoë", "main_hand": "left"}
    page = read_page(write_report(replace(session, details=details), analysis, tmp_path / "out"))
    lines = [text.strip() for text in page.text if text.strip()]
    assert f"Drag latency of {session.screen.name}" in lines
    said = {name: lines[lines.index(name) + 1] for name in ("Participant", "Session", "Operator", "Main hand")}
    assert list(said.values()) == list(details.values())


def test_drawings_bring_colours_for_a_dark_page_and_stay_whole(written: Path) -> None:
    page = written.read_text("utf-8")
    drawings = [base64.b64decode(text).decode() for text in re.findall(r"data:image/svg\+xml;base64,([\w+/=]+)", page)]
    assert len(drawings) >= 3
    for drawing in drawings:
        assert ET.fromstring(drawing).tag.endswith("svg")
        # Nothing is left that is drawn for white paper only, and every colour that is named is given.
        used = set(re.findall(r"var\((--figure-\w+)\)", drawing))
        light, dark = drawing.split("prefers-color-scheme:dark")[:2]
        assert used <= set(re.findall(r"(--figure-\w+):#", light)) & set(re.findall(r"(--figure-\w+):#", dark))
        body = drawing[drawing.index("</style>") :]
        assert not re.search(r"#(?:ffffff|222222|000000|dddddd)", body)
    # Outside the page they are ordinary drawings, for papers.
    assert "var(" not in (written.parent / "figures" / "latency.svg").read_text("utf-8")


def test_every_figure_stands_next_to_the_page_as_svg_and_png(written: Path) -> None:
    for name in ("latency", "stylus-width", "taps", "validation-speeds", "alignment-run-03", "alignment-run-14"):
        assert ET.parse(written.parent / "figures" / f"{name}.svg").getroot().tag.endswith("svg")
        assert (written.parent / "figures" / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_the_title_of_a_run_with_a_long_name_is_in_the_figure_whole(measured: tuple[Session, Analysis]) -> None:
    session, analysis = measured
    title = "onderhoudsmetingaanraakscherm-achterzijde-04: 1001 mm/s, latency 29.3 ms"
    with style.house_style():
        drawn = figures.alignment_figure(session.runs[0], analysis.runs[0].alignment, title, session)
        drawn.draw_without_rendering()
        heading = drawn.axes[0]._left_title
        box = heading.get_window_extent()
    assert heading.get_text().replace("\n", " ") == title
    assert drawn.bbox.xmin <= box.xmin < box.xmax <= drawn.bbox.xmax
    assert box.ymax <= drawn.bbox.ymax


def test_the_legend_of_a_run_is_between_its_axis_and_the_line_of_the_source(
    measured: tuple[Session, Analysis],
) -> None:
    session, analysis = measured
    with style.house_style():
        drawn = figures.alignment_figure(session.runs[0], analysis.runs[0].alignment, "run-03", session)
        style.sign(drawn, style.Source("a session", "2026-11-26T10:00", False))
        style.lay_out(drawn)
        drawn.draw_without_rendering()
        legend, axis = drawn.legends[0].get_window_extent(), drawn.axes[0].xaxis.label.get_window_extent()
        source = drawn._supxlabel.get_window_extent()
    assert drawn.bbox.ymin <= source.ymin < source.ymax <= legend.ymin < legend.ymax <= axis.ymin


def test_the_same_data_give_the_same_page(written: Path, tmp_path: Path, measured: tuple[Session, Analysis]) -> None:
    pages = [page.read_text("utf-8") for page in (written, write_report(*measured, tmp_path))]
    assert re.sub(r"data:image/[^\"]*", "", pages[0]) == re.sub(r"data:image/[^\"]*", "", pages[1])


def test_a_report_that_exists_is_left_alone(tmp_path: Path, measured: tuple[Session, Analysis]) -> None:
    (tmp_path / "report.html").write_text("precious")
    with pytest.raises(DataError, match="not overwritten"):
        write_report(*measured, tmp_path)
    assert (tmp_path / "report.html").read_text() == "precious"


def test_a_session_that_gave_nothing_still_has_a_report_that_says_so(tmp_path: Path) -> None:
    session = bare_session(Run("run-01", "circle", 0.0, 1.0, empty_touch(), empty_laser()))
    page = read_page(write_report(session, analyze(session), tmp_path))
    text = " ".join(page.text)
    assert "No run gave a latency." in text
    assert "run-01: no latency" in text


def test_a_session_without_taps_has_no_figure_of_taps(tmp_path: Path, measured: tuple[Session, Analysis]) -> None:
    session, analysis = measured
    written = write_journal_figures(session, replace(analysis, taps={}), tmp_path / "figures")
    names = {path.name.split("-")[0] for path in written}
    assert "latency" in names
    assert "taps" not in names


def test_a_run_that_does_not_count_is_no_headline_and_is_marked(
    measured: tuple[Session, Analysis], tmp_path: Path
) -> None:
    session, whole = measured
    fastest = max((run for run in whole.runs if run.latency_ms is not None), key=lambda run: run.speed_mm_s or 0.0)
    low_ms, high_ms = fastest.latency_ci95_ms or (0.0, 0.0)
    stated = f"{fastest.latency_ms:.2f} ms ({low_ms:.2f} to {high_ms:.2f}) at {fastest.speed_mm_s:.0f} mm/s"
    for exclude in ({}, {fastest.id: "a wrong speed"}):
        analysis = analyze(session, AnalysisOptions(form="constant", exclude=exclude))
        page = write_report(session, analysis, tmp_path / str(len(exclude))).read_text()
        assert (stated in page) is not bool(exclude)
        axes = analysis.plot()
        labels = [text.get_text() for text in axes.get_legend().get_texts()]
        assert ("run not in the curve" in labels) is bool(exclude)
