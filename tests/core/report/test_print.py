"""The report on paper: nothing is cut off, no heading stands alone at the foot of a page."""

from __future__ import annotations

import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from draglag.analysis import AnalysisOptions, analyze
from draglag.exchange import read_exchange
from draglag.latency.flags import MEANING
from draglag.recording import LogEntry, Session
from draglag.report import write_report
from draglag.report.notes import citation

SAMPLE = Path(__file__).parents[2] / "data" / "exchange" / "none-A"
OPTIONS = ("--headless", "--no-sandbox", "--disable-gpu", "--no-pdf-header-footer")
BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
PAPER_PT = {"A4": (595, 842), "Letter": (612, 792)}
MARGIN = 0.03  # of the width, 6 mm: what printers leave white
LONG_RUN = "onderhoudsmetingaanraakscherm-achterzijde-04"
FLAGS = tuple(MEANING)
DETAILS = {"participant": "P07", "session": "second", "operator": "Zoë", "dominant_hand": "left"}

pytestmark = [
    pytest.mark.skipif(BROWSER is None, reason="no Chromium to print with"),
    pytest.mark.skipif(shutil.which("pdftotext") is None, reason="no pdftotext (Debian: poppler-utils)"),
]


@dataclass(frozen=True)
class Word:
    """A word on paper; places are shares of the page's width or height."""

    text: str
    page: int
    left: float
    right: float
    bottom: float
    big: bool  # as headings are


def notes_in(session: Session) -> tuple[LogEntry, ...]:
    """One, 100 s after the session began."""
    return (LogEntry((session.started_s or 0.0) + 100.0, "note", "operator", "beam wiped"),)


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All runs of a sample, each with more to say than the one before; screen and a run have long Dutch names."""
    whole = read_exchange(SAMPLE)
    runs = tuple(replace(run, id=LONG_RUN) if run.id == "run-04" else run for run in whole.runs)
    screen = replace(whole.screen, name="Werkplaatsaanraakscherminstallatie achterzijde, onderhoudsbeurt")
    session = replace(whole, runs=runs, screen=screen, details=DETAILS, notes=notes_in(whole))
    found = analyze(session, AnalysisOptions(form="constant"))
    flagged = tuple(replace(run, flags=FLAGS[:k]) for k, run in enumerate(found.runs))
    checked = tuple(replace(item, flags=FLAGS[-6:]) for item in found.validation)
    return write_report(session, replace(found, runs=flagged, validation=checked), tmp_path_factory.mktemp("print"))


@pytest.fixture(scope="module", params=PAPER_PT)
def words(request: pytest.FixtureRequest, report: Path, tmp_path_factory: pytest.TempPathFactory) -> list[Word]:
    """What is printed on that paper."""
    folder = tmp_path_factory.mktemp(request.param)
    page = folder / "report.html"
    size = f"<style>@page {{ size: {request.param} }}</style></head>"
    page.write_text(report.read_text("utf-8").replace("</head>", size, 1), "utf-8")
    places = (f"--user-data-dir={folder}/user", f"--print-to-pdf={folder}/report.pdf", page.as_uri())
    subprocess.run([str(BROWSER), *OPTIONS, *places], check=True, capture_output=True)
    subprocess.run(["pdftotext", "-bbox", folder / "report.pdf", folder / "words.xml"], check=True)
    pages = ET.parse(folder / "words.xml").findall(".//{*}page")
    width, height = PAPER_PT[request.param]
    assert {(round(float(p.attrib["width"])), round(float(p.attrib["height"]))) for p in pages} == {(width, height)}
    return [
        Word(word.text or "", number, left / width, right / width, bottom / height, bottom - top > 13)
        for number, one in enumerate(pages)
        for word in one.findall("{*}word")
        for left, right, top, bottom in [[float(word.attrib[key]) for key in ("xMin", "xMax", "yMin", "yMax")]]
    ]


def verdicts(words: list[Word]) -> str:
    """The text of the verdict columns, and of what else stands below their heads."""
    found, column, page = [], 1.0, -1
    for word in sorted(words, key=lambda word: (word.page, round(word.bottom, 3), word.left)):
        if word.page != page:
            column, page = 1.0, word.page
        if word.text == "verdict":
            column = word.left - 0.001
        elif word.left >= column:
            found.append(word.text)
    return " ".join(found)


def test_every_column_is_on_the_page_whole(words: list[Word], report: Path) -> None:
    text = verdicts(words)
    wanted = [re.sub(r"<.*?>", "", cell) for cell in re.findall(r"<td[^>]*said.>(.*?)</td>", report.read_text("utf-8"))]
    assert len(wanted) == 15  # 13 circles, two runs of varying speed
    assert [verdict for verdict in wanted if verdict not in text] == []
    assert LONG_RUN in "".join(word.text for word in words if word.left < 0.1)
    assert all(MARGIN < word.left < word.right < 1 - MARGIN for word in words), "text runs into the margin"


def test_a_table_that_goes_on_has_its_head_again(words: list[Word]) -> None:
    assert len([word for word in words if word.text == "verdict"]) == 3  # of the runs on two pages, of the validation


def test_no_heading_stands_alone_at_the_foot_of_a_page(words: list[Word], report: Path) -> None:
    headings = re.findall(r"<h2>(.*?)</h2>", report.read_text("utf-8"))
    assert len(headings) >= 5
    for heading in headings:
        parts = heading.split()
        starts = range(len(words))
        (first,) = (words[k] for k in starts if words[k].big and [w.text for w in words[k : k + len(parts)]] == parts)
        assert first.bottom < 0.9, f"{heading} has nothing below it"


def test_the_last_lines_are_on_the_page_of_the_reference(words: list[Word]) -> None:
    (footer,) = [word.page for word in words if word.text == "Made"]
    assert footer == next(word.page for word in words if word.big and word.text == "cite")


def test_details_notes_and_reference_are_on_paper(words: list[Word]) -> None:
    text = " ".join(word.text for word in words)
    for printed in (
        "Participant P07",
        "Session second",
        "Operator Zoë",
        "Dominant hand left",
        "beam wiped",
        citation(),
    ):
        assert printed in text, printed
