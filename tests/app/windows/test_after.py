"""After a measurement: sessions come back, the table of runs is looked through, results leave in other forms."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from click.testing import CliRunner
from PySide6.QtCore import QMimeData, QPoint, QPointF, Qt, QUrl
from PySide6.QtGui import QDragEnterEvent, QDropEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QDoubleSpinBox, QLabel, QWidget
from scipy import stats

from draglag.curve import CurvePoints, fit_form
from draglag.curve.forms import FORMS
from draglag.errors import EstimateError
from draglag.gap import close_gap
from draglag.recording import empty_laser
from draglag.shown import matched
from draglag.store import read_analyses, read_session, write_session
from draglag_app.cli.main import cli
from draglag_app.windows import exports
from draglag_app.windows.pages import gap
from draglag_app.windows.parts.recent_menu import MOST, remembered
from draglag_app.windows.settings import load_settings
from draglag_app.windows.window import OperatorWindow
from draglag_app.windows.wording.equation import equation_html
from draglag_app.windows.workspace import kept_comments


def idle(window: OperatorWindow) -> Callable[[], bool]:
    return lambda: not window.space.tasks.running


def drop(window: OperatorWindow, *paths: Path, on: QWidget | None = None) -> bool:
    """Whether files dragged onto the window, or a part of it, were accepted; as file managers do, with the path as text
    too."""
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(path)) for path in paths])
    data.setText(str(paths[0]))
    copy, left, none = Qt.DropAction.CopyAction, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
    enter = QDragEnterEvent(QPoint(10, 10), copy, data, left, none)
    enter.ignore()
    QApplication.sendEvent(on or window, enter)
    if enter.isAccepted():
        QApplication.sendEvent(on or window, QDropEvent(QPointF(10, 10), copy, data, left, none))
    return enter.isAccepted()


def test_a_session_dropped_on_a_field_or_a_plot_opens_and_nothing_is_written_there(
    opened: OperatorWindow, session_file: Path, until: Callable
) -> None:
    page = opened.pages["results"][1]
    opened.go("results")
    for below in (page.filter, page.curve.viewport()):
        page.filter.setText("run-01")
        assert drop(opened, session_file, on=below)
        until(lambda: opened.space.path == session_file and not opened.space.tasks.running)
        assert page.filter.text() == ""  # words for the runs of another session
        assert not page.table.isRowHidden(0)
        opened.space.path = None


def test_several_dropped_sessions_are_compared(
    opened: OperatorWindow, session_file: Path, tmp_path: Path, until: Callable
) -> None:
    other = Path(shutil.copy(session_file, tmp_path / "other.h5"))
    assert not drop(opened, session_file, tmp_path)
    assert drop(opened, session_file, other)
    until(lambda: opened.pages["compare"][1].table.rowCount() == 2 and not opened.space.tasks.running)
    assert opened.page == "compare"


def test_a_dropped_session_opens_and_is_remembered(
    open_window: Callable, session_file: Path, tmp_path: Path, until: Callable
) -> None:
    window = open_window()
    (tmp_path / "notes.txt").write_text("no session")
    assert not drop(window, tmp_path / "notes.txt")
    assert drop(window, session_file)
    until(lambda: window.space.analysis is not None and not window.space.tasks.running)
    assert window.page == "results"
    window.recent.fill()
    assert session_file.name in window.recent.actions()[0].text()
    window.resize(740, 560)  # off screen there is no more room
    window.go("log")
    window.close()
    settings, problem = load_settings(window.space.settings_file)
    assert not problem
    assert settings.recent == (str(session_file),)
    assert settings.page == "log"
    again = open_window(**settings.model_dump())
    again.restore()
    assert again.page == "log"
    assert (again.width(), again.height()) == (740, 560)


def test_recent_sessions_are_few_and_each_is_there_once() -> None:
    known: list[str] = []
    for k in range(20):
        known = remembered(Path(f"/lab/{k % 12}.h5"), known)
    assert len(known) == MOST
    assert len(set(known)) == MOST
    assert known[0] == "/lab/7.h5"


def test_verdicts_are_in_sight_on_the_smallest_screen(opened: OperatorWindow) -> None:
    opened.resize(1280, 800)
    opened.go("results")
    QApplication.processEvents()
    table = opened.pages["results"][1].table
    verdict = 5
    assert table.columnViewportPosition(verdict) + table.columnWidth(verdict) <= table.viewport().width()


def test_runs_are_sorted_filtered_and_commented(opened: OperatorWindow, until: Callable) -> None:
    page, space = opened.pages["results"][1], opened.space
    speeds = [run.speed_mm_s for run in space.analysis.runs if run.speed_mm_s is not None]
    page.table.sortByColumn(2, Qt.SortOrder.DescendingOrder)
    shown = [page.table.item(row, 2).text() for row in range(len(speeds))]  # those without a speed come last
    assert shown == [f"{speed:.0f}" for speed in sorted(speeds, reverse=True)]
    run = page.table.item(0, 0).text()
    page.table.selectRow(0)
    space.comment(run, "stylus slipped")
    page.filter.setText("SLIPPED")
    rows = [row for row in range(page.table.rowCount()) if not page.table.isRowHidden(row)]
    assert [page.table.item(row, 0).text() for row in rows] == [run]
    page.filter.setText("")
    assert not any(page.table.isRowHidden(row) for row in range(page.table.rowCount()))
    space.keep_analysis()
    until(idle(opened))
    assert kept_comments(space.path) == {run: "stylus slipped"}
    opened.ask("undo")
    assert space.comments == {}
    opened.open_file(space.path)
    until(lambda: space.comments == {run: "stylus slipped"} and not space.tasks.running)


def test_a_run_included_by_hand_is_judged_again_in_another_session(
    opened: OperatorWindow, session_file: Path, tmp_path: Path, until: Callable
) -> None:
    session, space = read_session(session_file), opened.space
    run = session.runs[0].id
    aborted = replace(session, runs=(replace(session.runs[0], outcome="aborted"), *session.runs[1:]))
    first, second = (write_session(aborted, tmp_path / name) for name in ("first.h5", "second.h5"))
    opened.open_file(first)
    until(lambda: space.path == first and idle(opened)())
    assert space.analysis.excluded == {run: "aborted"}
    space.include(run)
    until(idle(opened))
    assert space.analysis.excluded == {}
    opened.open_file(second)
    until(lambda: space.path == second and idle(opened)())
    assert space.analysis.excluded == {run: "aborted"}


def test_a_run_that_failed_and_came_again_is_repeated_in_the_table_and_no_warning(
    opened: OperatorWindow, session_file: Path, tmp_path: Path, until: Callable
) -> None:
    session, space, table = read_session(session_file), opened.space, opened.pages["results"][1].table
    first = session.runs[0]
    blind, again = replace(first, laser=empty_laser(), outcome="aborted"), replace(first, id=f"{first.id}-2")
    path = write_session(replace(session, runs=(blind, *session.runs[1:], again)), tmp_path / "again.h5")
    opened.open_file(path)
    until(lambda: space.path == path and idle(opened)())
    said = {table.item(row, 0).text(): table.item(row, 5) for row in range(table.rowCount())}
    assert said[blind.id].text() == f"repeated as {again.id}"
    assert "aborted" in said[blind.id].toolTip()
    assert said[again.id].text() == "✓ good"
    assert blind.id not in opened.pages["results"][1].summary.text()


def test_a_wrong_diameter_of_the_stylus_is_corrected_undone_and_kept_with_the_results(
    opened: OperatorWindow, session_file: Path, tmp_path: Path, until: Callable
) -> None:
    session, space, results = read_session(session_file), opened.space, opened.pages["results"][1]
    path = write_session(replace(session, stylus=replace(session.stylus, diameter_mm=9.0)), tmp_path / "wrong.h5")
    opened.open_file(path)
    until(lambda: space.path == path and idle(opened)())
    opened.go("results")
    results.tabs.setCurrentWidget(results.width_view)
    assert "by ruler 9 mm" in results.summary.text()
    (field,) = [one for one in results.findChildren(QDoubleSpinBox) if one.accessibleName() == "Stylus diameter"]
    assert field.value() == 9.0
    field.setFocus()
    field.selectAll()
    QTest.keyClicks(field, "7")
    QTest.keyClick(field, Qt.Key.Key_Return)
    until(idle(opened))
    assert "by ruler" not in results.summary.text()
    assert "recorded as 9.00 mm" in [one.text() for one in results.findChildren(QLabel)]
    assert set(results.width_view.plot.drawn["ruler"][1]) == {7.0}
    space.keep_analysis()
    until(idle(opened))
    assert read_analyses(path)[-1].options["stylus_mm"] == 7.0
    assert read_session(path).stylus.diameter_mm == 9.0
    opened.ask("undo")
    until(idle(opened))
    assert field.value() == 9.0
    assert "by ruler 9 mm" in results.summary.text()
    opened.ask("redo")
    until(idle(opened))
    opened.open_file(session_file)
    until(lambda: space.path == session_file and idle(opened)())
    assert space.analysis.options.stylus_mm is None  # a correction belongs to its session


def test_the_gap_is_explained_with_the_corrected_diameter(
    opened: OperatorWindow, until: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[float] = []

    def fake(function: Callable, arguments: tuple, progress: Callable) -> dict:
        given.append(arguments[0].stylus.diameter_mm)
        raise EstimateError("not computed", "It is a test")

    monkeypatch.setattr(gap, "run_in_subprocess", fake)
    for diameter_mm in (9.0, 7.0):
        opened.space.correct_stylus(diameter_mm)
        until(idle(opened))
        opened.pages["gap"][1].explain_button.click()
        until(idle(opened))
    assert given == [9.0, 7.0]


def test_results_are_not_kept_with_raw_data_that_replaced_those_shown(opened: OperatorWindow, until: Callable) -> None:
    path = opened.space.path
    with h5py.File(path, "r+") as file:
        file[f"runs/{opened.space.analysis.runs[0].id}/touch/x_mm"][3] += 1
    opened.space.keep_analysis()
    until(idle(opened))
    assert opened.notice_text.text() == f"{path}: has other raw data now than were analysed. Open and analyse it again."
    assert read_analyses(path) == []


def test_kept_results_say_which_runs_were_chosen_by_hand(opened: OperatorWindow, until: Callable) -> None:
    space = opened.space
    left_out, taken_in = (run.id for run in space.analysis.runs[:2])
    space.exclude(left_out, "stylus slipped")
    space.include(taken_in)
    until(idle(opened))
    space.keep_analysis()
    until(idle(opened))
    (kept,) = read_analyses(space.path)
    assert kept.options["exclude"] == {left_out: "stylus slipped"}
    assert kept.options["include"] == [taken_in]
    chosen = ["--exclude", f"{left_out}=stylus slipped", "--include", taken_in]
    assert CliRunner().invoke(cli, ["analyze", str(space.path), *chosen]).exit_code == 0
    assert len(read_analyses(space.path)) == 1  # the same analysis with the same options, stored already


def test_the_session_leaves_in_every_form(opened: OperatorWindow, until: Callable, tmp_path: Path, monkeypatch) -> None:
    written = {
        "csv": tmp_path / "csv",
        "netcdf": tmp_path / "s.nc",
        "mat": tmp_path / "s.mat",
        "figures": tmp_path / "f",
    }
    for action, path in written.items():
        for asks in ("ask_new_folder", "ask_save"):
            monkeypatch.setattr(exports, asks, lambda *args, path=path: args[-1](path))
        opened.ask(action)
        until(idle(opened))
        assert path.name in opened.notice_text.text(), action
        assert path.exists(), action
    made = {path.name for path in written["figures"].iterdir()}
    assert {"latency-85mm.pdf", "latency-85mm.svg", "latency-180mm.pdf", "latency-180mm.svg"} <= made
    # PDF: a box in points of 1/72 inch.
    box = (written["figures"] / "latency-85mm.pdf").read_bytes().partition(b"/MediaBox [")[2].partition(b"]")[0].split()
    assert abs(float(box[2]) / 72 * 25.4 - 85.0) < 0.5
    assert not read_analyses(opened.space.path)  # nothing was written into the session


@pytest.mark.parametrize("form", list(FORMS))
def test_every_form_of_the_curve_has_its_equation(form: str) -> None:
    speeds = np.geomspace(44, 1000, 16)
    latency_s = 0.021 + 0.031 * (speeds / 100) ** -0.5
    text = equation_html(fit_form(CurvePoints(speeds, latency_s, np.full(16, 3e-4)), form))
    assert text.startswith("L")
    assert text.count(" = ") >= len(FORMS[form].names)  # each coefficient with its value
    assert " ," not in text.replace("\u00a0", " ").replace("&nbsp;", " ")  # a number without a unit ends with its error


def test_the_equation_has_its_coefficients_with_matched_digits(opened: OperatorWindow) -> None:
    text, curve = opened.pages["results"][1].equation.text(), opened.space.analysis.curve
    assert text.startswith("L(v) = ")
    # As of all that the windows show: half a 95 % interval.
    name, value = list(curve.parameters.items())[-1]
    reach = float(stats.t.ppf(0.975, curve.n_points - len(curve.parameters)))
    asymptote = matched(value, reach * curve.standard_errors[name])
    assert f" = {asymptote}" in text.replace("&nbsp;±&nbsp;", " ± ")
    assert matched(123.456, 1.23) == "123.5 ± 1.2"
    assert matched(0.018143, 0.00085) == "0.01814 ± 0.00085"
    assert matched(419.3, 37.0) == "419 ± 37"
    assert matched(7.0, 0.0996) == "7.00 ± 0.10"
    assert matched(29.77, 0.0) == "29.77"


def test_the_gap_report_is_saved_from_the_window(
    opened: OperatorWindow, until: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, impossible = tmp_path / "gap.html", opened.space.path / "gap.html"  # a file is no folder
    places = [out, impossible]
    monkeypatch.setattr(gap, "ask_save", lambda *args: args[-1](places.pop(0)))
    opened.ask("gap_report")
    assert "Explain the gap first" in opened.notice_text.text()
    assert len(places) == 2  # no place was asked for

    found = close_gap(opened.space.session, max_effects=0)
    with monkeypatch.context() as computed:
        shown = {**found.to_dict(), "report": found, "missing": [], "model": None}
        computed.setattr(gap, "run_in_subprocess", lambda function, arguments, progress: shown)
        opened.pages["gap"][1].explain_button.click()
        until(idle(opened))
    opened.ask("gap_report")
    until(idle(opened))
    assert opened.notice_text.text() == f"Saved: {out}"
    page = out.read_text("utf-8")
    assert opened.space.session.name in page
    assert f"{found.gap_first_mm:.2f}" in page
    assert "<svg" in page or "<img" in page
    opened.ask("gap_report")
    until(idle(opened))
    assert opened.notice_text.text().startswith(str(opened.space.path))
    assert "Saved" not in opened.notice_text.text()
