"""A whole simulated session through the real windows: set-up, record, results, export."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QCloseEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QMessageBox

from draglag.analysis import analyze
from draglag.exchange import read_exchange
from draglag.latency import estimate_on_clock, with_systematics
from draglag.store import partial_files, read_analyses, read_session
from draglag_app.session import SessionOptions, events
from draglag_app.session.digest import within
from draglag_app.windows import files
from draglag_app.windows.recording.session_thread import Order
from draglag_app.windows.window import OperatorWindow
from draglag_devices.rig import make_rig

N_CIRCLES, N_RUNS = 6, 7


def column(window: OperatorWindow, table: str, index: int) -> list[str]:
    rows = window.record.table if table == "record" else window.pages["results"][1].table
    return [rows.item(row, index).text() for row in range(rows.rowCount())]


def test_recording(recorded: OperatorWindow) -> None:
    """One recording, looked at from all sides: it takes seconds."""
    path, shown = recorded.space.path, recorded.space.analysis
    # The results are those of the file.
    assert path.parent == Path(recorded.space.settings.folder)
    assert partial_files(path.parent) == []
    assert shown.to_dict() == analyze(read_session(path)).to_dict()
    assert len(shown.runs) == N_CIRCLES
    assert [v.protocol for v in shown.validation] == ["chirp"]
    assert shown.taps["touch"].n == 10
    # Estimates appeared run by run and are the final ones.
    final = {run.id: run.latency_s for run in shown.runs}
    assert {run.id: run.latency_s for run in recorded.space.live.known} == final
    assert recorded.space.live.curve is not None
    drawn_ms = np.sort(recorded.record.live.curve.drawn["runs"][1])
    assert drawn_ms == pytest.approx(np.sort([1e3 * v for v in final.values()]))
    # The record page lists every run with its verdict.
    assert column(recorded, "record", 0) == [f"run-0{k}" for k in range(1, N_RUNS + 1)]
    assert sum("✓" in text for text in column(recorded, "record", 5)) == N_CIRCLES
    assert recorded.record.facts["taps"].value.text() == "10 / 10"
    assert recorded.record.facts["lost"].value.text() == "0"
    # The live plots show touch, edges and speed of the last run, the chirp; the hand follows within a few per cent.
    assert {"touch", "beam", "beam blocked", "beam clear"} <= set(recorded.record.live.trace.drawn)
    t_s, mm_s = recorded.record.live.speed.drawn["stylus"]
    target = np.interp(t_s, *recorded.record.live.speed.drawn["target"])
    good = np.isfinite(mm_s)
    assert np.median(np.abs(mm_s[good] - target[good]) / target[good]) < 0.1
    # The window shows the results.
    assert recorded.stack.currentWidget() is recorded.pages["results"][1]
    assert path.name in recorded.header.session.text()
    assert "Saved" in recorded.notice_text.text()
    # The log lists every run, and hides it when only errors are asked for.
    log = recorded.pages["log"][1]
    texts = [log.table.item(row, 3).text() for row in range(log.table.rowCount())]
    assert sum("touch events" in text for text in texts) == N_RUNS
    log.level.setCurrentIndex(3)
    log._filter()
    assert all(log.table.isRowHidden(row) for row in range(log.table.rowCount()))


class TestResults:
    def test_leaving_a_run_out_can_be_undone(self, opened: OperatorWindow, until: Callable) -> None:
        space = opened.space
        first = space.analysis.runs[0].id
        before = space.analysis.curve.n_points
        space.exclude(first, "the stylus slipped")
        until(lambda: space.analysis.curve.n_points == before - 1)
        results = opened.pages["results"][1]
        assert any("the stylus slipped" in text for text in column(opened, "results", 5))
        assert "excluded" in results.curve.drawn
        opened.ask("undo")
        until(lambda: space.analysis.curve.n_points == before and not space.tasks.running)
        assert "excluded" not in results.curve.drawn

    def test_every_run_can_be_looked_into(self, opened: OperatorWindow, until: Callable) -> None:
        results, session = opened.pages["results"][1], opened.space.session
        for run in session.runs:
            results.table.select(run.id)
            for tab in range(results.tabs.count()):
                results.tabs.setCurrentIndex(tab)
                until(lambda: not opened.space.tasks.running)
        results.tabs.setCurrentWidget(results.alignment)
        results.table.select("run-01")
        estimate = opened.space.analysis.runs[0]
        shown = sum(len(results.alignment.drawn[name][0]) for name in ("top, shifted", "bottom, shifted"))
        assert shown == len(estimate.alignment.edge_t_s)

    def test_cost_has_its_minimum_at_the_estimate(self, opened: OperatorWindow, until: Callable) -> None:
        results = opened.pages["results"][1]
        results.tabs.setCurrentWidget(results.cost)
        for estimate in opened.space.analysis.runs:
            results.table.select(estimate.id)
            until(lambda estimate=estimate: estimate.id in results.cost.drawn and not opened.space.tasks.running)
            shift_ms, cost = results.cost.drawn[estimate.id]
            low, high = estimate.latency_ci95_s
            slack_ms = 3 + 1e3 * (high - low)
            assert shift_ms[np.argmin(cost)] == pytest.approx(1e3 * estimate.latency_s, abs=slack_ms)

    def test_other_estimator(self, opened: OperatorWindow, until: Callable) -> None:
        results = opened.pages["results"][1]
        results.estimator.setCurrentIndex(1)
        results._options_chosen()
        until(lambda: opened.space.analysis.options.estimator == "paper")
        assert opened.space.analysis.curve is not None

    def test_rivals_are_drawn_next_to_the_curve(self, opened: OperatorWindow, until: Callable) -> None:
        results = opened.pages["results"][1]
        before = set(results.curve.drawn)
        results.show_alternatives.click()
        until(lambda: not opened.space.tasks.running)
        assert len(set(results.curve.drawn) - before) >= 2

    def test_kept_results_are_in_the_file(self, opened: OperatorWindow, until: Callable) -> None:
        opened.space.keep_analysis()
        until(lambda: not opened.space.tasks.running)
        (kept,) = read_analyses(opened.space.path)
        assert kept.up_to_date
        assert kept.result["curve"]["form"] == opened.space.analysis.curve.form

    def test_export_writes_an_exchange_folder(
        self, opened: OperatorWindow, until: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        out = tmp_path / "exchange"
        monkeypatch.setattr("draglag_app.windows.parts.ask_files.pick_files", lambda *asked: asked[-1]([out]))
        files.export_session(opened)
        until(lambda: not opened.space.tasks.running)
        assert len(read_exchange(out).runs) == N_RUNS
        assert opened.notice_text.text() == f"Saved: {out}"

    def test_themes_redraw_everything(self, opened: OperatorWindow) -> None:
        drawn = set(opened.pages["results"][1].curve.drawn)
        opened.ask("theme")
        assert opened.space.settings.theme == "light"
        assert set(opened.pages["results"][1].curve.drawn) == drawn
        opened.ask("theme")


class TestSteering:
    def test_keyboard_alone(self, open_window: Callable, until: Callable) -> None:
        window = open_window(begin_by_hand=True)
        window.activateWindow()
        assert QTest.qWaitForWindowActive(window)
        done = window.record.table.rowCount
        QTest.keyClick(window, Qt.Key.Key_F5)
        until(lambda: done() == 1)
        QTest.keyClick(window, Qt.Key.Key_F7)
        until(lambda: done() == 2)
        QTest.keyClick(window, Qt.Key.Key_F4)
        until(lambda: window.record.buttons["proceed"].isEnabled())
        QTest.keyClicks(window.record.note, "the beam was wiped")
        QTest.keyClick(window.record.note, Qt.Key.Key_Return)
        QTest.keyClick(window, Qt.Key.Key_F6)
        until(lambda: done() == 3)
        QTest.keyClick(window, Qt.Key.Key_F9)
        until(lambda: not window.space.recording.active)
        until(lambda: window.space.analysis is not None)
        session = window.space.session
        assert [run.id for run in session.runs][:2] == ["run-01", "run-01-2"]
        assert any(entry.text == "the beam was wiped" for entry in session.notes)
        assert window.notice_text.text() == f"Stopped by the operator. Saved: {window.space.path}"

    def test_closing_while_recording_asks_first(
        self, open_window: Callable, until: Callable, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        window = open_window(begin_by_hand=True)
        window.ask("start")
        until(lambda: window.record.table.rowCount() == 1)
        monkeypatch.setattr("draglag_app.windows.window.sure_to_stop", lambda window: False)
        refused = QCloseEvent()
        window.closeEvent(refused)
        assert not refused.isAccepted()
        assert window.space.recording.active
        monkeypatch.setattr("draglag_app.windows.window.sure_to_stop", lambda window: True)
        agreed = QCloseEvent()
        window.closeEvent(agreed)
        assert agreed.isAccepted()
        (path,) = Path(window.space.settings.folder).glob("*.h5")
        assert [run.id for run in read_session(path).runs] == ["run-01"]

    def test_actions_follow_the_recording(self, open_window: Callable, until: Callable) -> None:
        window = open_window(begin_by_hand=True)
        made = window.actions_table.made
        assert made["start"].isEnabled()
        assert not made["stop"].isEnabled()
        window.ask("start")
        until(lambda: window.record.table.rowCount() == 1)
        assert not made["start"].isEnabled()
        assert made["stop"].isEnabled()
        window.ask("stop")
        until(lambda: not window.space.recording.active)
        assert made["start"].isEnabled()


class TestStart:
    def test_without_instruments_nothing_starts(self, open_window: Callable) -> None:
        window = open_window(rig={}, first_start=True)
        assert window.stack.currentWidget() is window.bench
        assert window.header.lights["touch"].state == "fault"
        window.start()
        assert not window.space.recording.active
        assert "touchscreen" in window.notice_text.text()

    def test_first_start_offers_the_simulated_rig(self, open_window: Callable) -> None:
        window = open_window(rig={}, first_start=True)
        assert window.bench.welcome.isVisible()
        window.bench.use_simulated.click()
        assert not window.bench.welcome.isVisible()
        assert window.space.settings.rig.touch == "sim:"
        assert window.header.lights["laser"].state == "ready"

    def test_missing_walt_asks_and_no_is_the_default(
        self, open_window: Callable, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        window = open_window(rig={"touch": "sim:", "laser": "sim:", "fast": True})
        asked = {}

        def question(parent: object, title: str, text: str, **more: object) -> QMessageBox.StandardButton:
            asked.update(text=text, **more)
            return QMessageBox.StandardButton.No

        monkeypatch.setattr(QMessageBox, "question", question)
        window.start()
        assert "WALT" in asked["text"]
        assert asked["defaultButton"] == QMessageBox.StandardButton.No
        assert not window.space.recording.active

    def test_an_instrument_that_failed_its_check_is_asked_about(
        self, open_window: Callable, until: Callable, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        window = open_window(rig={"touch": "sim:", "laser": "csv:/nowhere/laser.csv", "walt": "sim:"})
        window.ask("check")
        until(lambda: not window.space.tasks.running)
        asked = {}

        def question(parent: object, title: str, text: str, **more: object) -> QMessageBox.StandardButton:
            asked.update(text=text, **more)
            return QMessageBox.StandardButton.No

        monkeypatch.setattr(QMessageBox, "question", question)
        window.start()
        assert "/nowhere/laser.csv" in asked["text"]
        assert asked["defaultButton"] == QMessageBox.StandardButton.No
        assert not window.space.recording.active

    def test_wrong_address_is_one_sentence(self, open_window: Callable, qapp: QApplication) -> None:
        window = open_window(rig={"touch": "nonsense", "laser": "sim:", "walt": "sim:", "fast": True})
        window.start()
        assert "nonsense" in window.notice_text.text()
        assert not window.space.recording.active

    def test_checking_the_rig_lights_the_lamps(self, open_window: Callable, until: Callable) -> None:
        window = open_window(rig={"touch": "sim:", "laser": "csv:/nowhere/laser.csv"})
        window.ask("check")
        until(lambda: not window.space.tasks.running)
        assert window.header.lights["touch"].state == "ready"
        assert window.header.lights["laser"].state == "fault"
        assert "/nowhere" in window.bench.words["laser"].text()


def test_a_run_is_estimated_at_once_and_again_when_its_last_events_are_there(
    opened: OperatorWindow, until: Callable
) -> None:
    space, record = opened.space, opened.record
    run = next(run for run in space.session.runs if run.protocol == "circle")
    early = replace(run, touch=within(run.touch, run.start_s, run.start_s + run.duration_s))
    real = make_rig({"touch": "sim:", "laser": "sim:"}, "screen-1", fast=False)
    space.recording.order = Order(space.protocol, real, Path("x.h5"), SessionOptions(space.session.screen))
    record.table.clear_runs()

    space.bridge.listener(events.RunPreviewed(early, space.session.clocks))
    until(lambda: len(space.live.known) == 1)
    assert column(opened, "record", 0) == [run.id]
    assert column(opened, "record", 5) == ["preliminary"]
    expected = with_systematics(estimate_on_clock(early, space.session.clocks, 7.0))
    assert space.live.known[0].latency_s == expected.latency_s

    space.bridge.listener(events.RunFinished(run, "complete", space.session.clocks))
    until(lambda: not space.live.preliminary)
    assert column(opened, "record", 0) == [run.id]
    assert column(opened, "record", 5) == ["✓ good"]
    assert [known.latency_s for known in space.live.known] == [
        with_systematics(estimate_on_clock(run, space.session.clocks, 7.0)).latency_s
    ]

    # A run that is lost in its last moments keeps no estimate.
    space.bridge.listener(events.RunPreviewed(replace(early, id="run-90"), space.session.clocks))
    space.bridge.listener(events.RunFinished(replace(run, id="run-90"), "device_lost", space.session.clocks))
    until(lambda: record.table.rowCount() == 2 and not space.tasks.running)
    assert "run-90" not in [known.id for known in space.live.known]
    assert column(opened, "record", 5)[1].startswith("✕")


def test_an_uncertain_laser_clock_is_reported_on_record_and_results(opened: OperatorWindow, until: Callable) -> None:
    """Three milliseconds of doubt: on the page of the run, in its verdict, and above the curve."""
    space = opened.space
    session = space.session
    wide = tuple(
        replace(
            run,
            sync=tuple(
                replace(part, host_min_s=part.host_min_s - 3e-3, host_max_s=part.host_max_s + 3e-3) for part in run.sync
            ),
        )
        for run in session.runs
    )
    record, results = opened.record, opened.pages["results"][1]
    assert record.clock_warning.isHidden()
    assert "clock" not in results.summary.text()
    diameter = session.stylus.diameter_mm
    space.live.take(estimate_on_clock(wide[0], session.clocks, diameter))
    assert not record.clock_warning.isHidden()
    assert "±3." in record.clock_warning.text()
    assert wide[0].id in record.clock_warning.text()
    space.take(replace(session, runs=wide), None)
    until(lambda: space.analysis is not None and not space.tasks.running)
    assert "clock shifts the latency" in results.summary.text()
    assert any("clock uncertain" in text for text in column(opened, "results", 5))
