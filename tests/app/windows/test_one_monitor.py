"""A single monitor for participant and operator: who has it when, and that notes are always within reach."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from PySide6.QtCore import QPoint, QRect, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLabel, QLineEdit, QMessageBox, QPushButton, QWidget

from draglag_app.session.machine import Phase
from draglag_app.windows.window import OperatorWindow

pytestmark = pytest.mark.usefixtures("short_countdown")


def in_window(widget: QWidget) -> QRect:
    """Where a widget is in its window."""
    return QRect(widget.mapTo(widget.window(), QPoint(0, 0)), widget.size())


def short_runs(window: OperatorWindow, duration_s: float, rest_s: float) -> None:
    run = window.space.protocol.runs[1].model_copy(update={"speeds_mm_s": (425.0, 600.0), "duration_s": duration_s})
    window.space.set_protocol(window.space.protocol.model_copy(update={"runs": (run,), "taps": None, "rest_s": rest_s}))


@pytest.fixture
def shared(open_window: Callable, monkeypatch: pytest.MonkeyPatch) -> OperatorWindow:
    """The participant looks at the screen that the operator's window is on; runs take a second, rests for ever."""
    # The screen that is drawn off screen is square, unlike the panel: start anyway.
    monkeypatch.setattr(QMessageBox, "question", lambda *asked, **more: QMessageBox.StandardButton.Yes)
    window = open_window(rig={"touch": "sim:", "laser": "sim:", "display": "screen 1"})
    short_runs(window, 1.0, 600.0)
    return window


def notes_of(window: OperatorWindow) -> list[str]:
    session = window.space.session
    return [entry.text for entry in (*session.notes, *(one for run in session.runs for one in run.log))]


def named(parent: QWidget, kind: type, words: str) -> QWidget:
    """The one visible widget of that kind and accessible name or text."""
    (found,) = [
        one
        for one in parent.findChildren(kind)
        if one.isVisible() and (one.accessibleName() == words or (kind is not QLineEdit and one.text() == words))
    ]
    return found


def test_in_a_rest_the_operators_window_is_in_front_and_for_a_run_the_target(
    shared: OperatorWindow, until: Callable
) -> None:
    shared.ask("start")
    participant = shared.space.recording.window
    until(lambda: shared.record._phase is Phase.RECORDING)
    assert participant.isFullScreen()
    assert participant.geometry() == participant.screen().geometry()  # true to size
    assert not [one for one in participant.findChildren(QWidget) if one.isVisible()]  # the target, and nothing over it
    until(lambda: shared.record.buttons["proceed"].isVisible() and shared.isActiveWindow())
    shared.ask("proceed")
    until(lambda: shared.record._phase is Phase.RECORDING and participant.isActiveWindow())
    assert participant.isFullScreen()
    assert not [one for one in participant.findChildren(QWidget) if one.isVisible()]
    shared.ask("stop")
    until(lambda: not shared.space.recording.active)


def test_a_desktop_that_shows_the_target_in_an_ordinary_window_is_asked_for_full_screen_again(
    shared: OperatorWindow, until: Callable
) -> None:
    """As X desktops do with a window that was hidden: true to size is over, and no rest would be recognised."""
    shared.ask("start")
    participant = shared.space.recording.window
    until(lambda: shared.record._phase is Phase.RECORDING)
    participant.setWindowState(Qt.WindowState.WindowNoState)
    until(participant.isFullScreen)
    until(lambda: shared.record.buttons["proceed"].isVisible() and shared.isActiveWindow())
    shared.ask("stop")
    until(lambda: not shared.space.recording.active)


def in_first_rest(shared: OperatorWindow, until: Callable) -> QWidget:
    """The participant's window, with the bar of the rest before the first run."""
    shared.ask("start")
    participant = shared.space.recording.window
    until(lambda: [one for one in participant.findChildren(QLineEdit) if one.isVisible()])
    return participant


def test_a_rest_on_the_participants_screen_takes_a_note_by_touch_and_says_the_state(
    shared: OperatorWindow, until: Callable
) -> None:
    participant = in_first_rest(shared, until)
    line = named(participant, QLineEdit, "Note")
    assert named(participant, QLabel, "Note").buddy() is line
    assert [one for one in participant.findChildren(QLabel) if "left in the session" in one.text()]
    for seen in participant.findChildren(QPushButton):
        assert participant.rect().contains(in_window(seen))
        assert seen.width() >= seen.minimumSizeHint().width()
    QTest.keyClicks(line, "the beam was wiped")
    touch(named(participant, QPushButton, "Keep note"))
    assert line.text() == ""
    assert "the beam was wiped" in shared.record.note.placeholderText()
    touch(named(participant, QPushButton, "Begin next run now"))
    until(lambda: not line.isVisible())
    shared.ask("stop")
    until(lambda: shared.space.session is not None and not shared.space.tasks.running)
    assert "the beam was wiped" in notes_of(shared)


def by_tab_to(window: QWidget, wanted: QWidget) -> None:
    """Press Tab until that widget has the keyboard."""
    for _ in range(40):
        if QApplication.focusWidget() is wanted:
            return
        QTest.keyClick(QApplication.focusWidget() or window, Qt.Key.Key_Tab)
    raise AssertionError("Tab does not lead there")


def test_the_bar_of_a_rest_is_in_sight_and_served_by_the_keyboard_alone(
    shared: OperatorWindow, until: Callable
) -> None:
    participant = in_first_rest(shared, until)
    participant.activateWindow()  # as on a desktop that keeps the participant's window in front
    until(participant.isActiveWindow)
    line = named(participant, QLineEdit, "Note")
    controls = [line, *(one for one in participant.findChildren(QPushButton) if one.isVisible())]
    for control in controls:
        by_tab_to(participant, control)
        place = in_window(control)
        assert participant.rect().contains(place)
        assert not [one for one in controls if one is not control and in_window(one).intersects(place)]
        assert control.visibleRegion().boundingRect() == control.rect()  # nothing lies over it
    by_tab_to(participant, line)
    QTest.keyClicks(line, "sleeve in the beam")
    QTest.keyClick(line, Qt.Key.Key_Return)
    assert line.text() == ""
    by_tab_to(participant, named(participant, QPushButton, "Begin next run now"))
    QTest.keyClick(QApplication.focusWidget(), Qt.Key.Key_Space)
    until(lambda: not line.isVisible())
    shared.ask("stop")
    until(lambda: shared.space.session is not None and not shared.space.tasks.running)
    assert "sleeve in the beam" in notes_of(shared)


def test_next_to_a_docked_picture_the_note_is_in_sight_and_served_by_the_keyboard_alone(
    open_window: Callable, until: Callable
) -> None:
    window = open_window(rig={"touch": "sim:", "laser": "sim:", "display": "window"})
    short_runs(window, 60.0, 600.0)
    window.setGeometry(window.screen().availableGeometry())
    window.ask("start")
    until(lambda: window.record._phase is Phase.RECORDING)
    picture, note = window.space.recording.window, window.record.note
    assert picture.window() is window
    window.activateWindow()
    until(window.isActiveWindow)
    for reach in (lambda: by_tab_to(window, note), lambda: QTest.keyClick(picture, Qt.Key.Key_F4)):
        picture.setFocus()
        reach()
        assert QApplication.focusWidget() is note
        assert note.visibleRegion().boundingRect() == note.rect()
    QTest.keyClicks(note, "slipped")
    QTest.keyClick(note, Qt.Key.Key_Return)
    assert "slipped" in note.placeholderText()
    window.ask("stop")
    until(lambda: window.space.session is not None and not window.space.tasks.running)
    assert "slipped" in notes_of(window)


def touch(widget: QWidget) -> None:
    """A finger on the middle of a widget."""
    device = QTest.createTouchDevice()
    window, centre = widget.window(), in_window(widget).center()
    QTest.touchEvent(window.windowHandle(), device).press(0, centre).commit()
    QTest.touchEvent(window.windowHandle(), device).release(0, centre).commit()
    QApplication.processEvents()


def test_without_room_next_to_it_the_picture_is_docked_and_covers_nothing(
    open_window: Callable, until: Callable, qapp: QApplication
) -> None:
    window = open_window(rig={"touch": "sim:", "laser": "sim:", "display": "window"})
    short_runs(window, 60.0, 600.0)
    window.setGeometry(window.screen().availableGeometry())
    window.ask("start")
    picture = window.space.recording.window
    until(lambda: window.record._phase is Phase.RECORDING)
    qapp.processEvents()
    assert picture.window() is window
    assert picture.isVisible()
    panel = window.space.settings.panel.screen()
    assert picture.height() / picture.width() == pytest.approx(panel.height_mm / panel.width_mm, rel=0.02)
    assert picture.width() >= 200
    heading = named(window.record, QLabel, "What the participant sees")
    assert 0 <= in_window(picture).top() - in_window(heading).bottom() < 20  # right below its heading
    for control in (window.record.note, window.record.table, *window.record.buttons.values()):
        assert not control.isVisible() or not in_window(control).intersects(in_window(picture))
    assert named(window.record, QLabel, "Note").buddy() is window.record.note
    QTest.keyClick(window.windowHandle(), Qt.Key.Key_Escape)
    until(lambda: window.record.big.text() == "✕ aborted")
    window.ask("stop")
    until(lambda: not window.space.recording.active)
    shown = [one.text() for one in window.record.findChildren(QLabel) if one.isVisibleTo(window.record)]
    assert "What the participant sees" not in shown


def test_the_crosses_of_a_calibration_are_docked_too_and_cover_no_button(
    open_window: Callable, until: Callable, qapp: QApplication
) -> None:
    window = open_window(rig={"touch": "sim:", "laser": "sim:", "display": "window"})
    window.setGeometry(window.screen().availableGeometry())
    window.ask("calibrate")
    calibrating, panel = window.space.calibrating, window.geometry_page.calibration
    until(lambda: panel.back.isEnabled())
    picture = calibrating.window
    assert picture.window() is window
    assert picture.visibleRegion().boundingRect() == picture.rect()
    assert picture.width() >= 200
    size = window.space.settings.panel.screen()
    assert picture.height() / picture.width() == pytest.approx(size.height_mm / size.width_mm, rel=0.02)
    for control in (panel.back, panel.cancel):
        assert control.visibleRegion().boundingRect() == control.rect()  # nothing lies over it
    assert not panel.picture.isVisible()
    QTest.keyClick(window.windowHandle(), Qt.Key.Key_Backspace)
    assert calibrating.active
    QTest.keyClick(window.windowHandle(), Qt.Key.Key_Escape)
    assert not calibrating.active
    qapp.processEvents()
    assert panel.picture.isVisible()
    shown = [one.text() for one in panel.findChildren(QLabel) if one.isVisibleTo(panel)]
    assert "What the participant sees" not in shown


def test_with_a_monitor_each_nothing_changes_place(
    shared: OperatorWindow, until: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    from draglag_app.windows.participant.window import ParticipantWindow

    monkeypatch.setattr(ParticipantWindow, "screen", lambda self: None)  # not the operator's
    shared.ask("start")
    participant = shared.space.recording.window
    until(lambda: shared.record.buttons["proceed"].isVisible() and shared.record.table.rowCount() == 1)
    assert not [one for one in participant.findChildren(QWidget) if one.isVisible()]
    shared.ask("stop")
    until(lambda: not shared.space.recording.active)
