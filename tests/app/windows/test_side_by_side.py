"""The participant's display in a window leaves the operator's in sight, on a single monitor too."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from PySide6.QtCore import QPoint, QRect
from PySide6.QtWidgets import QWidget

from draglag_app.windows.participant.side_by_side import places

RATIO = 9 / 16


@pytest.mark.parametrize(
    ("screen", "operator"),
    [
        (QRect(0, 0, 3840, 2160), QRect(100, 100, 1280, 800)),  # room at the right
        (QRect(0, 0, 1920, 1080), QRect(320, 140, 1280, 800)),  # in the middle: only when it steps aside
        (QRect(0, 0, 1920, 1080), QRect(640, 0, 1280, 800)),  # at the right: the display goes to the left
        (QRect(0, 30, 1200, 1890), QRect(0, 500, 1200, 800)),  # upright: above or below
        (QRect(1920, 0, 1920, 1040), QRect(2200, 50, 1280, 800)),  # the second of two
    ],
)
def test_the_display_stands_next_to_the_operators_window(screen: QRect, operator: QRect) -> None:
    place, corner = places(screen, operator, RATIO)
    moved = QRect(corner, operator.size())
    assert screen.contains(place)
    assert screen.contains(moved)
    assert not place.intersects(moved)
    assert place.width() >= 400
    assert place.height() == pytest.approx(place.width() * RATIO, abs=1)


def test_without_room_next_to_it_the_state_and_the_buttons_stay_in_sight() -> None:
    screen = QRect(0, 0, 1366, 768)
    place, corner = places(screen, screen, RATIO)
    assert corner == QPoint(0, 0)
    assert screen.contains(place)
    assert place.bottomRight() == screen.bottomRight()
    assert place.top() > screen.height() / 2
    assert place.width() > 400


def assert_next_to(window: QWidget, participant: QWidget, screen: QRect, before: QRect) -> None:
    expected, corner = places(screen, before, 286.4 / 509.2)
    assert window.pos() == corner
    assert expected.contains(participant.geometry())
    assert participant.geometry().width() >= expected.width() - 20


def test_a_session_opens_the_display_where_it_leaves_the_most_in_sight(open_window: Callable) -> None:
    window = open_window(rig={"touch": "sim:", "laser": "sim:", "display": "window"})
    window.space.set_protocol(window.space.protocol.model_copy(update={"taps": None}))
    window.resize(740, 560)  # leaves room on the smallest screen that tests are drawn on
    screen, before = window.screen().availableGeometry(), window.frameGeometry()
    window.ask("start")
    assert_next_to(window, window.space.recording.window, screen, before)
    window.ask("stop")


def test_a_calibration_opens_it_there_too(open_window: Callable) -> None:
    window = open_window(rig={"touch": "sim:", "laser": "sim:", "display": "window"})
    window.resize(740, 560)
    screen, before = window.screen().availableGeometry(), window.frameGeometry()
    window.ask("calibrate")
    assert_next_to(window, window.space.calibrating.window, screen, before)
    window.ask("cancel")
