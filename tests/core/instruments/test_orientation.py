"""A touchscreen that is turned against the picture on it is noticed; a hand that follows, however late, is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from draglag.instruments.orientation import wrong_way_round
from draglag.protocol.targets import Circle, Target
from draglag.recording import Screen, TouchTrace, empty_touch

SCREEN = Screen("panel", 509.2, 286.4, 1920, 1080)
START_S = 100.0


def touches(target: Target, late_s: float, wander_mm: float = 5.0, until_s: float = 4.0) -> TouchTrace:
    """A hand that comes after 0.6 s and then follows, late and not quite."""
    rng = np.random.default_rng(4)
    t_s = np.arange(0.6, until_s, 0.01)
    x_mm, y_mm = target.position_mm(np.maximum(t_s - late_s, 0))
    wander = np.cumsum(rng.normal(0, 0.05 * wander_mm, (2, t_s.size)), axis=1)
    return TouchTrace(START_S + t_s, x_mm + wander[0], y_mm + wander[1], np.zeros(t_s.size, np.int64))


def seen_as(trace: TouchTrace, left_right: bool, top_bottom: bool) -> TouchTrace:
    x_mm = SCREEN.width_mm - trace.x_mm if left_right else trace.x_mm
    y_mm = SCREEN.height_mm - trace.y_mm if top_bottom else trace.y_mm
    return replace(trace, x_mm=x_mm, y_mm=y_mm)


def circle(speed_mm_s: float) -> Circle:
    return Circle(60.0, 143.2, 50.0, speed_mm_s, sideways_mm_s=4.0, duration_s=40.0)


@pytest.mark.parametrize("speed_mm_s", [44.0, 240.0, 1000.0])
@pytest.mark.parametrize("late_s", [0.03, 0.3])
def test_the_right_way_round_is_left_alone(speed_mm_s: float, late_s: float) -> None:
    target = circle(speed_mm_s)
    assert wrong_way_round(touches(target, late_s), target, START_S, SCREEN) is None


@pytest.mark.parametrize("speed_mm_s", [44.0, 240.0, 1000.0])
def test_half_a_turn_is_noticed_at_any_speed(speed_mm_s: float) -> None:
    target = circle(speed_mm_s)
    trace = seen_as(touches(target, 0.12), True, True)
    assert wrong_way_round(trace, target, START_S, SCREEN) == "turned"


def test_a_mirror_is_distinguished_from_a_turn() -> None:
    target = replace(circle(100.0), centre_y_mm=80.0)
    trace = touches(target, 0.12)
    assert wrong_way_round(seen_as(trace, True, False), target, START_S, SCREEN) == "left_right"
    assert wrong_way_round(seen_as(trace, False, True), target, START_S, SCREEN) == "top_bottom"
    assert wrong_way_round(seen_as(trace, True, True), target, START_S, SCREEN) == "turned"


def test_a_hand_elsewhere_and_few_touches_tell_nothing() -> None:
    target = circle(100.0)
    trace = touches(target, 0.1)
    elsewhere = replace(trace, x_mm=np.full(trace.t_s.size, 250.0), y_mm=np.full(trace.t_s.size, 20.0))
    assert wrong_way_round(elsewhere, target, START_S, SCREEN) is None
    few = touches(target, 0.1, until_s=0.7)
    assert wrong_way_round(seen_as(few, True, True), target, START_S, SCREEN) is None
    assert wrong_way_round(empty_touch(), target, START_S, SCREEN) is None
