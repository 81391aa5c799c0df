"""The operator's keys reach: from the participant's window, from fields, and back to where the keyboard was."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QWidget

from draglag.protocol.runs import load_protocol
from draglag_app.session.machine import Phase
from draglag_app.windows.actions import ELSEWHERE
from draglag_app.windows.pages.geometry import GeometryPage
from draglag_app.windows.pages.protocol import ProtocolPage
from draglag_app.windows.window import OperatorWindow

Key = Qt.Key
CONTROL = Qt.KeyboardModifier.ControlModifier
SHIFT = Qt.KeyboardModifier.ShiftModifier


def to_front(window: QWidget, until: Callable) -> None:
    window.activateWindow()
    until(window.isActiveWindow)


def page_of(window: OperatorWindow, name: str) -> QWidget:
    return window.pages[name][1]


class TestFromTheParticipantsWindow:
    @pytest.fixture
    def window(self, open_window: Callable, until: Callable, short_countdown: None) -> OperatorWindow:
        """A long run in real time, with the keyboard at the participant's window, as after every start."""
        window = open_window(rig={"touch": "sim:", "laser": "sim:", "display": "window"})
        (run,) = (window.space.protocol.runs[1].model_copy(update={"speeds_mm_s": (425.0, 600.0), "duration_s": 60.0}),)
        window.space.set_protocol(
            window.space.protocol.model_copy(update={"runs": (run,), "taps": None, "rest_s": 600.0})
        )
        window.ask("start")
        until(lambda: window.record._phase is Phase.RECORDING)
        to_front(window.space.recording.window, until)
        return window

    def test_a_note_is_written_and_the_keyboard_goes_back(self, window: OperatorWindow, until: Callable) -> None:
        participant = window.space.recording.window
        QTest.keyClick(participant, Key.Key_F4)
        until(window.isActiveWindow)
        assert QApplication.focusWidget() is window.record.note
        QTest.keyClicks(window.record.note, "slipped")
        QTest.keyClick(window.record.note, Key.Key_Return)
        until(participant.isActiveWindow)
        assert "slipped" in window.record.note.placeholderText()
        QTest.keyClick(participant, Key.Key_F9)
        until(lambda: window.space.session is not None and not window.space.tasks.running)
        kept = [*window.space.session.notes, *(entry for run in window.space.session.runs for entry in run.log)]
        assert "slipped" in [entry.text for entry in kept]

    def test_runs_are_repeated_aborted_and_begun(self, window: OperatorWindow, until: Callable) -> None:
        participant, table = window.space.recording.window, window.record.table
        QTest.keyClick(participant, Key.Key_F7)
        until(lambda: "repeated next" in window.record.small.text())
        QTest.keyClick(participant, Key.Key_F8)
        until(lambda: table.rowCount() == 1 and window.record.big.text() == "✕ aborted")
        assert "repeated next" in window.record.small.text()
        QTest.keyClick(participant, Key.Key_F6)
        until(lambda: window.record._phase is Phase.RECORDING)
        QTest.keyClick(participant, Key.Key_Escape)
        until(lambda: table.rowCount() == 2)
        assert [table.item(row, 0).text() for row in range(2)] == ["run-01", "run-01-2"]

    def test_pages_come_forward(self, window: OperatorWindow, until: Callable) -> None:
        QTest.keyClick(window.space.recording.window, Key.Key_8, CONTROL)
        until(window.isActiveWindow)
        assert window.stack.currentWidget() is page_of(window, "log")


def test_before_the_first_run_there_is_nothing_to_repeat(open_window: Callable, until: Callable) -> None:
    window = open_window(begin_by_hand=True)
    check = load_protocol("demo").clock_check
    window.space.set_protocol(window.space.protocol.model_copy(update={"taps": None, "clock_check": check}))
    record = window.record
    window.ask("start")
    until(lambda: record.big.text() == "Rest")  # after the clocks were compared
    assert not record.buttons["repeat"].isEnabled()
    window.ask("repeat")
    assert record.small.text().endswith(" · F6 begins the first run now")
    window.ask("proceed")
    until(lambda: record.table.rowCount() == 1 and "F7 repeats the last one" in record.small.text())
    assert record.buttons["repeat"].isEnabled()
    window.ask("repeat")  # which begins it, too, where runs wait for the operator
    until(lambda: record.table.rowCount() == 2)
    assert [record.table.item(row, 0).text() for row in range(2)] == ["run-01", "run-01-2"]
    window.ask("stop")
    until(lambda: not window.space.recording.active)


class TestUndo:
    def test_what_a_field_has_given_is_undone_by_the_window(self, open_window: Callable, until: Callable) -> None:
        window = open_window()
        to_front(window, until)
        QTest.keyClick(window, Key.Key_2, CONTROL)
        page = page_of(window, "geometry")
        assert isinstance(page, GeometryPage)
        field = page.fields["stylus_mm"]
        field.setFocus()
        field.selectAll()
        QTest.keyClicks(field, "5.5")
        QTest.keyClick(field, Key.Key_Z, CONTROL)  # not given yet: the field's own
        assert field.value() == window.space.settings.panel.stylus_mm == 7.0
        field.selectAll()
        QTest.keyClicks(field, "5.5")
        QTest.keyClick(field, Key.Key_Return)
        assert window.space.settings.panel.stylus_mm == 5.5
        QTest.keyClick(field, Key.Key_Z, CONTROL)
        assert window.space.settings.panel.stylus_mm == field.value() == 7.0
        QTest.keyClick(field, Key.Key_Z, CONTROL | SHIFT)
        assert window.space.settings.panel.stylus_mm == field.value() == 5.5

    def test_speeds_of_a_protocol_too(self, open_window: Callable, until: Callable) -> None:
        window = open_window()
        to_front(window, until)
        QTest.keyClick(window, Key.Key_3, CONTROL)
        page = page_of(window, "protocol")
        assert isinstance(page, ProtocolPage)
        before, speeds = window.space.protocol, page.editor.speeds
        speeds.setFocus()
        speeds.selectAll()
        QTest.keyClicks(speeds, "90, 200")
        QTest.keyClick(speeds, Key.Key_Return)
        assert window.space.protocol.runs[0].speeds_mm_s == (90.0, 200.0)
        QTest.keyClick(speeds, Key.Key_Z, CONTROL)
        assert window.space.protocol == before

    def test_it_says_what_it_would_undo_and_rests_where_there_is_nothing(self, open_window: Callable) -> None:
        window = open_window()
        undo, redo = (window.actions_table.made[name] for name in ("undo", "redo"))
        page = page_of(window, "protocol")
        assert isinstance(page, ProtocolPage)
        assert not undo.isEnabled()
        assert not redo.isEnabled()
        window.go("protocol")
        page.table.selectRow(0)
        page._copy()
        assert (undo.text(), undo.isEnabled(), redo.isEnabled()) == ("Undo: copy runs", True, False)
        assert page.file_buttons["Undo"].isEnabled()
        window.ask("undo")
        assert (undo.text(), undo.isEnabled(), redo.text()) == ("Undo", False, "Redo: copy runs")
        assert window.notice_text.text() == "Undone: copy runs"
        window.go("results")
        assert window.notice_text.text() == ""  # a remark is not shown on every page
        window.notify("warning", "look here")
        window.go("log")
        assert window.notice_text.text() == "look here"


def test_export_is_not_taken_for_the_end_of_a_line(
    opened: OperatorWindow, until: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[object] = []
    monkeypatch.setattr("draglag_app.windows.files.ask_new_folder", lambda *more: asked.append(more))
    to_front(opened, until)
    QTest.keyClick(opened, Key.Key_9, CONTROL)
    field = page_of(opened, "preferences").operator  # type: ignore[attr-defined]
    field.setFocus()
    QTest.keyClicks(field, "me")
    QTest.keyClick(field, Key.Key_E, CONTROL)
    assert len(asked) == 1


def test_a_run_left_out_can_be_taken_in_by_the_same_button(opened: OperatorWindow, until: Callable) -> None:
    page = page_of(opened, "results")
    chosen = opened.space.analysis.runs[1].id
    opened.go("results")
    page.table.select(chosen)  # type: ignore[attr-defined]
    opened.space.exclude(chosen, "slipped")
    until(lambda: not opened.space.tasks.running)
    assert page.exclude_button.text() == "Include"  # type: ignore[attr-defined]
    page.exclude_button.click()  # type: ignore[attr-defined]
    until(lambda: not opened.space.tasks.running)
    assert opened.space.options.exclude == {}
    assert page.exclude_button.text() == "Exclude…"  # type: ignore[attr-defined]


def test_the_keyboard_comes_back_to_the_button_whose_work_is_done(
    open_window: Callable, until: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("draglag_app.windows.pages.bench._WATCH_S", 0.0)
    window = open_window()
    to_front(window, until)
    window.go("bench")
    button = window.bench.check_button
    button.setFocus()
    QTest.keyClick(button, Key.Key_Space)
    assert QApplication.focusWidget() is not button
    until(lambda: button.isEnabled() and not window.space.tasks.running)
    assert QApplication.focusWidget() is button
    QTest.keyClick(button, Key.Key_Space)
    QTest.keyClick(window, Key.Key_1, CONTROL)
    window.bench.display.setFocus()  # gone elsewhere meanwhile: it stays there
    until(lambda: button.isEnabled() and not window.space.tasks.running)
    assert QApplication.focusWidget() is window.bench.display


def test_help_lists_every_key_there_is(open_window: Callable) -> None:
    text = page_of(open_window(), "help").keys.toPlainText()  # type: ignore[attr-defined]
    assert [keys for keys, _ in ELSEWHERE if keys not in text] == []
