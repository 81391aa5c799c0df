"""The participant's display, on a clock that the test moves."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from PySide6.QtCore import QEvent, QPointF, Qt
from PySide6.QtGui import QCloseEvent, QColor, QFont, QFontMetricsF, QImage, QTouchEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from draglag.protocol.targets import Circle, Tap
from draglag.recording import Screen
from draglag_app.windows.participant.screen_display import ScreenDisplay
from draglag_app.windows.participant.window import BACKGROUND, DONE, PRACTICE, TARGET, ParticipantWindow

SCREEN = Screen("s", 200.0, 100.0, 1600, 800)
CIRCLE = Circle(100.0, 50.0, 30.0, 100.0, duration_s=5.0)


class Clock:
    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def window(qapp: QApplication, clock: Clock, monkeypatch: pytest.MonkeyPatch) -> Iterator[ParticipantWindow]:
    """Painted when the test says so, never when a window system or a timer likes: it is not on any screen."""
    made = ParticipantWindow(SCREEN, clock)
    made.resize(800, 400)
    monkeypatch.setattr(made, "repaint", lambda region: made.grab(region.boundingRect()))
    monkeypatch.setattr(made._timer, "start", lambda wait_ms: None)
    yield made
    made.hide_target()
    made.close()
    made.deleteLater()


@pytest.fixture
def shown(qapp: QApplication, clock: Clock) -> Iterator[ParticipantWindow]:
    """On a screen, for keys and touches."""
    made = ParticipantWindow(SCREEN, clock)
    made.resize(800, 400)
    made.show()
    qapp.processEvents()
    yield made
    made.hide_target()
    made.close()
    made.deleteLater()


def coloured_mm(window: ParticipantWindow, colour: str) -> tuple[float, float]:
    """Centre of the pixels of about that colour, mm."""
    image = window.grab().toImage().convertToFormat(QImage.Format.Format_RGB32)
    data = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), image.bytesPerLine() // 4, 4)
    wanted = QColor(colour)
    near = np.abs(data[..., :3].astype(int) - [wanted.blue(), wanted.green(), wanted.red()]).max(axis=2) < 30
    near[: image.height() // 8] = False  # the words
    y, x = np.nonzero(near)
    ratio = image.width() / SCREEN.width_mm
    return float(x.mean() + 0.5) / ratio, float(y.mean() + 0.5) / ratio


class TestWhereAndWhen:
    @pytest.mark.parametrize("at_s", [0.0, 0.37, 1.9])
    def test_target_is_drawn_where_the_clock_says(self, window: ParticipantWindow, clock: Clock, at_s: float) -> None:
        window.show_target(CIRCLE, clock.now_s)
        clock.now_s += at_s
        x_mm, y_mm = CIRCLE.position_mm(at_s)
        assert coloured_mm(window, TARGET) == pytest.approx((float(x_mm), float(y_mm)), abs=0.5)

    def test_it_stands_still_before_the_start(self, window: ParticipantWindow, clock: Clock) -> None:
        window.show_target(CIRCLE, clock.now_s + 3)
        clock.now_s += 2
        x_mm, y_mm = CIRCLE.position_mm(0.0)
        assert coloured_mm(window, TARGET) == pytest.approx((float(x_mm), float(y_mm)), abs=0.5)
        assert len(window.frames.take(np.inf).t_s) == 0

    def test_every_frame_is_logged_with_what_was_drawn(self, window: ParticipantWindow, clock: Clock) -> None:
        start_s = clock.now_s
        window.show_target(CIRCLE, start_s)
        for _ in range(30):
            clock.now_s += 1 / 60 + 1e-7
            window._tick()
        logged = window.frames.take(start_s + 0.4)
        rest = window.frames.take(np.inf)
        assert logged.t_s.max() <= start_s + 0.4
        t_s = np.concatenate([logged.t_s, rest.t_s])
        assert len(np.unique(t_s)) == 31
        x_mm, y_mm = CIRCLE.position_mm(t_s - start_s)
        assert np.concatenate([logged.x_mm, rest.x_mm]) == pytest.approx(x_mm)
        assert np.concatenate([logged.y_mm, rest.y_mm]) == pytest.approx(y_mm)
        assert logged.missed + rest.missed == 0

    def test_late_frames_are_counted(self, window: ParticipantWindow, clock: Clock) -> None:
        window.show_target(CIRCLE, clock.now_s)
        for slots in (1, 1, 4, 1, 2):
            clock.now_s += slots / 60 + 1e-6
            window._tick()
        assert window.frames.take(np.inf).missed == 3 + 1

    def test_a_frame_of_its_own_is_drawn_only_around_the_target(
        self, window: ParticipantWindow, clock: Clock, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        window.show_target(CIRCLE, clock.now_s - 4)  # the words have gone by then
        clock.now_s += 1 / 60
        window._tick()
        areas = []
        monkeypatch.setattr(
            window, "paintEvent", lambda event, paint=window.paintEvent: (areas.append(event.region()), paint(event))
        )
        clock.now_s += 1 / 60
        window._tick()
        share = sum(r.width() * r.height() for region in areas for r in region) / (window.width() * window.height())
        assert 0 < share < 0.1


class TestWords:
    def test_countdown_then_instruction_then_silence(self, window: ParticipantWindow, clock: Clock) -> None:
        window.show_target(CIRCLE, clock.now_s + 3)
        said = []
        for _ in range(8):
            said.append(window._present_words())
            clock.now_s += 1
        assert [words.partition("\n")[2] for words in said[:3]] == ["3", "2", "1"]
        assert all("Touch the circle" in words for words in said[:3])
        assert all("Keep the circle" in words for words in said[3:6])
        assert said[6:] == ["", ""]

    def test_lost_contact_is_reported_and_taken_back(self, window: ParticipantWindow, clock: Clock) -> None:
        window.show_target(CIRCLE, clock.now_s - 4)
        window.set_contact(False)
        assert "Contact lost" in window._present_words()
        window.set_contact(True)
        assert window._present_words() == ""

    def test_a_stylus_that_is_not_there_when_the_run_begins_is_asked_for(
        self, window: ParticipantWindow, clock: Clock
    ) -> None:
        window.set_contact(False)  # it was lifted after the run before
        window.show_target(CIRCLE, clock.now_s + 3)
        assert "Touch the circle" in window._present_words()
        clock.now_s += 5
        assert "put the stylus back" in window._present_words()

    def test_practice_looks_different(self, window: ParticipantWindow, clock: Clock) -> None:
        window.show_target(CIRCLE, clock.now_s + 3)
        window.set_practice(True)
        assert "Practice" in window._present_words()
        x_mm, y_mm = CIRCLE.position_mm(0.0)
        assert coloured_mm(window, PRACTICE) == pytest.approx((float(x_mm), float(y_mm)), abs=0.5)

    def test_prompts_show_between_runs(self, window: ParticipantWindow, clock: Clock) -> None:
        window.set_prompt("Rest")
        assert window._present_words() == "Rest"
        image = window.grab().toImage()
        colours = {image.pixelColor(x, y).name() for x in range(0, 800, 3) for y in range(20, 60)}
        assert len(colours - {BACKGROUND}) > 1

    def test_it_says_when_all_is_done(self, window: ParticipantWindow, clock: Clock) -> None:
        window.show_target(CIRCLE, clock.now_s)
        window.hide_target()
        assert window._present_words() == DONE
        clock.now_s += 60.0
        assert window._present_words() == DONE

    def test_tap_target_keeps_its_prompt(self, window: ParticipantWindow, clock: Clock) -> None:
        window.set_prompt("Tap")
        window.show_target(Tap(100, 50, 10), clock.now_s)
        assert "Tap the spot 10 times" in window._present_words()


class TestHands:
    def test_escape_aborts_and_the_window_stays(self, shown: ParticipantWindow, clock: Clock) -> None:
        heard: list[bool] = []
        shown.aborted.connect(lambda: heard.append(True))
        shown.show_target(CIRCLE, clock.now_s)
        QTest.keyClick(shown, Qt.Key.Key_Escape)
        QTest.keyClick(shown, Qt.Key.Key_Space)
        QTest.keyClick(shown, Qt.Key.Key_Q, Qt.KeyboardModifier.ControlModifier)
        assert heard == [True]
        assert shown.isVisible()

    def test_closing_it_by_the_desktops_keys_ends_the_run_not_the_program(self, shown: ParticipantWindow) -> None:
        class ByTheDesktop(QCloseEvent):
            def spontaneous(self) -> bool:
                return True

        heard: list[bool] = []
        shown.closing.connect(lambda: heard.append(True))
        event = ByTheDesktop()
        shown.closeEvent(event)
        assert heard == [True]
        assert not event.isAccepted()
        assert shown.isVisible()

    def test_touches_are_taken_and_never_become_mouse_events(self, shown: ParticipantWindow) -> None:
        touch = QTouchEvent(QEvent.Type.TouchBegin)
        touch.ignore()
        assert shown.event(touch)
        assert touch.isAccepted()
        assert shown.testAttribute(Qt.WidgetAttribute.WA_AcceptTouchEvents)
        QTest.mouseClick(shown, Qt.MouseButton.LeftButton, pos=QPointF(10, 10).toPoint())
        assert shown.isVisible()


class TestFromAnotherThread:
    def test_session_thread_may_call_it(self, window: ParticipantWindow, clock: Clock, until: Callable) -> None:
        display = ScreenDisplay(window)
        start_s = clock.now_s

        def session() -> None:
            display.prompt("run-01: follow the target")
            display.show(CIRCLE, start_s)

        thread = threading.Thread(target=session, name="draglag-test")
        thread.start()
        thread.join()
        until(lambda: window._target is CIRCLE)
        clock.now_s += 0.25
        window._tick()
        assert display.frames(np.inf).t_s[-1] == pytest.approx(start_s + 0.25)
        display.hide()
        until(lambda: window._target is None)
        assert "Done" in window._present_words()


def inked_rows(window: ParticipantWindow) -> np.ndarray:
    """Which rows of the picture have letters."""
    drawn = window.grab().toImage().convertToFormat(QImage.Format.Format_Grayscale8)
    rows = np.frombuffer(drawn.constBits(), np.uint8).reshape(drawn.height(), drawn.bytesPerLine())
    return (rows[:, : drawn.width()] > 120).any(axis=1)


def test_words_are_whole_in_a_small_picture_and_apart_from_the_count_down(
    qapp: QApplication, clock: Clock, window: ParticipantWindow
) -> None:
    """As it is docked in the operator's window: letters with tails keep them."""
    window.resize(276, 155)
    window.show_target(Circle(100.0, 90.0, 5.0, 100.0, duration_s=5.0), clock.now_s + 2)
    font = QFont(window.font())
    font.setPixelSize(14)
    tall = QFontMetricsF(font).tightBoundingRect("Touch the circle to begin").height()
    changes = np.flatnonzero(np.diff(np.concatenate([[0], inked_rows(window)[:80].astype(int)])))
    words_from, words_to, count_from = changes[:3]
    assert words_to - words_from >= tall - 1
    assert count_from > words_to


@pytest.mark.parametrize("size", [(400, 800), (450, 360), (800, 400)])
def test_words_are_whole_on_an_upright_or_narrow_screen(
    qapp: QApplication, clock: Clock, window: ParticipantWindow, size: tuple[int, int]
) -> None:
    window.resize(*size)
    for words in ("Comparing clocks: leave the screen alone", "Rest"):
        window.set_prompt(words)
        drawn = window.grab().toImage().convertToFormat(QImage.Format.Format_Grayscale8)
        rows = np.frombuffer(drawn.constBits(), np.uint8).reshape(drawn.height(), drawn.bytesPerLine())
        ink = (rows[:, : drawn.width()] > 100).any(axis=0)
        margin = drawn.width() // 100
        assert ink.any()
        assert not ink[:margin].any()
        assert not ink[-margin:].any()
