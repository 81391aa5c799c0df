"""Names that hold markup are shown as they are written, on every page and in every report."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from dataclasses import replace
from html.parser import HTMLParser
from importlib.resources import files
from pathlib import Path

import pytest
from PySide6.QtCore import Qt as Core
from PySide6.QtGui import Qt
from PySide6.QtWidgets import (
    QAbstractItemView,
    QApplication,
    QGraphicsTextItem,
    QGraphicsView,
    QLabel,
    QListWidget,
    QTextBrowser,
    QWidget,
)

from draglag.analysis import Analysis, analyze
from draglag.provenance import Source
from draglag.recording import LogEntry, Session
from draglag.report import write_report
from draglag.reproduction.drawings import comparison_page
from draglag.store import read_session, write_session
from draglag_app.windows.parts.plain import plain
from draglag_app.windows.window import OperatorWindow
from draglag_devices.discovery import Found

# An element that would load something, a script, an entity, TeX that matplotlib cannot read, the end of an attribute.
HOSTILE = "<img src='file:///x' onerror=\"alert(1)\"><script>alert(1)</script>&amp; $\\frac{ \"'>"
TAGS = ("img", "script")


@pytest.fixture(scope="module")
def hostile(session_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session in which every text that a person or a device gives is hostile."""
    session = read_session(session_file)
    entry = LogEntry(session.runs[0].start_s, "warning", HOSTILE, HOSTILE)
    runs = tuple(replace(run, log=(*run.log, entry)) for run in session.runs)
    path = tmp_path_factory.mktemp("hostile") / "session <b>x<b> $y.h5"
    changed = replace(
        session, name=HOSTILE, runs=runs, notes=(entry,), screen=replace(session.screen, name=HOSTILE),
        stylus=replace(session.stylus, name=HOSTILE), software=HOSTILE, started_utc=HOSTILE,
        devices=dict.fromkeys(session.devices, f"sim: · {HOSTILE}"),
    )  # fmt: skip
    return write_session(changed, path) or path


def views(window: OperatorWindow) -> Iterator[tuple[str, str]]:
    """(place, text) of everything that Qt would draw as markup."""
    for widget in window.findChildren(QWidget):
        place = f"{type(widget).__name__} {widget.objectName()}"
        if Qt.mightBeRichText(widget.toolTip()):
            yield f"tooltip of {place}", widget.toolTip()
        if isinstance(widget, QLabel) and (
            widget.textFormat() == Core.TextFormat.RichText
            or (widget.textFormat() == Core.TextFormat.AutoText and Qt.mightBeRichText(widget.text()))
        ):
            yield place, widget.text()
        if isinstance(widget, QTextBrowser):
            yield place, widget.toHtml()
        if isinstance(widget, QGraphicsView):
            texts = (item for item in widget.scene().items() if isinstance(item, QGraphicsTextItem))
            yield from ((f"text in {place}", text.toHtml()) for text in texts)
        if isinstance(widget, QAbstractItemView) and widget.model() is not None:
            yield from _cells(place, widget)


def _cells(place: str, view: QAbstractItemView) -> Iterator[tuple[str, str]]:
    model = view.model()
    for row in range(model.rowCount()):
        for column in range(1 if isinstance(view, QListWidget) else model.columnCount()):
            tip = model.index(row, column).data(Core.ItemDataRole.ToolTipRole)
            if Qt.mightBeRichText(str(tip or "")):
                yield f"tooltip in {place}", str(tip)


class _Elements(HTMLParser):
    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attributes)))


OWN = ("data:image/", str(files("draglag_resources") / "manual"))
"""Where the program's own pictures come from: drawn by itself, and of the manual."""


def obeyed(text: str) -> list[str]:
    """The hostile elements that whoever draws this HTML would obey."""
    return [tag for tag, attributes in _Elements(text).found
            if (tag in TAGS and not (attributes.get("src") or "").startswith(OWN))
            or any(name.startswith("on") for name in attributes)]  # fmt: skip


def test_the_trial_itself_sees_what_is_obeyed() -> None:
    assert obeyed(f"<p>{HOSTILE}</p>") == ["img", "script"]
    assert obeyed(plain(HOSTILE)) == []
    assert plain("2 < 3 & more") == "2 < 3 & more"


def test_no_page_obeys_markup(
    hostile: Path, open_window: Callable[..., OperatorWindow], until: Callable[[Callable[[], bool]], None]
) -> None:
    window = open_window()
    window.space.open(hostile)
    until(lambda: window.space.analysis is not None and not window.space.tasks.running)
    protocol = window.space.protocol.model_copy(update={"name": HOSTILE, "description": HOSTILE})
    window.space.set_protocol(protocol)
    window.pages["bench"][1]._discovered([Found("sim:" + HOSTILE, ("touch",), HOSTILE, False, HOSTILE)])
    compare = window.pages["compare"][1]
    compare.add_files([hostile])
    until(lambda: not window.space.tasks.running)
    window.notify("error", HOSTILE)
    window.header.set_light("touch", "fault", HOSTILE)
    shown = 0
    for name in window.pages:
        window.go(name)
        QApplication.processEvents()
        for place, text in views(window):
            assert obeyed(text) == [], f"{name}: {place} obeys {text[:200]}"
        shown += sum("<img" in label.text() for label in window.findChildren(QLabel) if label.isVisible())
    assert shown > 3, "the names were not shown: nothing was tried"


@pytest.fixture(scope="module")
def analysed(hostile: Path) -> tuple[Session, Analysis]:
    session = read_session(hostile)
    return session, analyze(session)


def test_no_report_obeys_markup(analysed: tuple[Session, Analysis], tmp_path: Path) -> None:
    session, analysis = analysed
    page = write_report(session, analysis, tmp_path / "report").read_text("utf-8")
    assert "&lt;img src=" in page
    assert obeyed(page) == []
    for drawing in (tmp_path / "report").rglob("*.svg"):
        names = {element.tag.rpartition("}")[2] for element in ET.parse(drawing).iter()}
        assert not names & {"img", "script", "foreignObject"}, drawing


def test_a_comparison_obeys_no_markup(analysed: tuple[Session, Analysis]) -> None:
    _, analysis = analysed
    assert analysis.curve is not None
    curves = [
        (HOSTILE, analysis.curve, Source(HOSTILE, HOSTILE, False)),
        ("other", analysis.curve, Source("b", "", False)),
    ]
    page = comparison_page(curves)
    assert "&lt;img src=" in page
    assert obeyed(page) == []
