"""Targets are where the paper's formulas say, at the speed they say."""

import numpy as np
import pytest

from draglag.errors import DataError
from draglag.protocol.targets import (
    MULTISINE_PERIOD_S,
    STEP_FRACTIONS,
    Chirp,
    Circle,
    MultiSine,
    Step,
    Tap,
    check_on_screen,
    target_from_parameters,
)
from draglag.recording import Screen

SCREEN = Screen("Screen 1", 509.2, 286.4, 1920, 1080)
CIRCLE = Circle(150, 143, 50, 200, 40, 4)
CHIRP = Chirp(150, 143, 50.92, sideways_mm_s=2)
MULTISINE = MultiSine(150, 143, 30, sideways_mm_s=4)
STEP = Step(150, 140, 114.56, 0.01, sideways_mm_s=4)
TAP = Tap(200, 100, 10)
ALL = [CIRCLE, CHIRP, MULTISINE, STEP, TAP]


@pytest.mark.parametrize("target", ALL, ids=lambda t: t.kind)
def test_velocity_is_the_derivative_of_position(target):
    t = np.linspace(0.011, min(39.0, target.duration_s - 0.1), 777)
    h = 1e-5
    for after, before, v in zip(
        target.position_mm(t + h), target.position_mm(t - h), target.velocity_mm_s(t), strict=True
    ):
        assert (after - before) / (2 * h) == pytest.approx(v, abs=2e-3)  # a minimum-jerk start has jerk 60·d/T³


@pytest.mark.parametrize("target", ALL, ids=lambda t: t.kind)
def test_parameters_make_the_same_target_again(target):
    parameters = target.parameters()
    assert parameters["kind"] == target.kind
    assert target_from_parameters(target.kind, parameters) == target


def test_circle_turns_at_its_nominal_speed_about_a_centre_that_moves_sideways():
    t = np.linspace(0, 40, 4001)
    vx, vy = CIRCLE.velocity_mm_s(t)
    assert np.hypot(vx - 4, vy) == pytest.approx(200)
    x, y = CIRCLE.position_mm(t)
    assert np.hypot(x - 150 - 4 * t, y - 143) == pytest.approx(50)
    assert float(CIRCLE.position_mm(0.0)[1]) == pytest.approx(93)  # begins at the top


def test_circle_turns_clockwise_on_the_screen_unless_asked_otherwise():
    assert CIRCLE.velocity_mm_s(0.0)[0] > 0  # at the top, to the right; y grows downwards
    back = Circle(150, 143, 50, 200, 40, 4, turn=-1)
    assert back.velocity_mm_s(0.0)[0] < 0


def test_chirp_rises_from_a_twentieth_to_one_hertz_in_eighty_seconds():
    speed = np.hypot(*(np.array(CHIRP.velocity_mm_s([0.0, 40.0, 80.0])) - [[2], [0]]))
    assert speed / (2 * np.pi * 50.92) == pytest.approx([0.05, 0.525, 1.0])


def test_chirp_covers_the_integral_of_its_frequency():
    t = np.linspace(0, 80, 80001)
    x, y = CHIRP.position_mm(t)
    angle = np.unwrap(np.arctan2(y - 143, x - 150 - 2 * t))
    assert (angle[-1] - angle[0]) / (2 * np.pi) == pytest.approx(0.525 * 80)


def test_multisine_has_the_lines_of_table_1_and_repeats():
    n = 4096
    t = np.arange(n) / n * MULTISINE_PERIOD_S
    y = MultiSine(0, 0, 1.0).position_mm(t)[1]
    lines = np.fft.rfft(y) / (n / 2)
    table = {4: (1.079, 7.239), 7: (0.776, 0.506), 13: (0.391, 7.86), 19: (0.225, 8.184), 29: (0.117, 9.012)}
    table |= {37: (0.082, 6.141), 43: (0.066, 6.776), 59: (0.051, 6.265), 79: (0.035, 4.432)}
    table |= {109: (0.028, 2.672), 157: (0.024, 8.009)}
    for k, (amplitude, phase) in table.items():
        assert abs(lines[k]) == pytest.approx(amplitude, abs=1e-9)
        off = np.angle(lines[k]) - (phase - np.pi / 2)  # a sine is a cosine a quarter late
        assert np.sin(off / 2) == pytest.approx(0, abs=1e-9)
    rest = np.delete(np.abs(lines), list(table))
    assert rest.max() < 1e-9
    assert MultiSine(0, 0, 1.0).position_mm(t + MULTISINE_PERIOD_S)[1] == pytest.approx(y)


def test_steps_cross_the_beam_at_the_named_shares_of_the_bell_both_ways():
    t = np.arange(0, STEP.cycle_s, 1e-4)
    x, y = STEP.position_mm(t)
    height = y - 140 - 0.01 * x
    i = np.flatnonzero(np.diff(np.sign(height)))
    assert len(i) == 2 * len(STEP_FRACTIONS)
    shares = []
    for k in i:
        move = int(t[k] / (STEP.move_s + STEP.rest_s))
        begin, end = move * (STEP.move_s + STEP.rest_s), move * (STEP.move_s + STEP.rest_s) + STEP.move_s
        a, b = np.interp([begin, end], t, height)
        assert abs(b - a) == pytest.approx(114.56, rel=1e-4)
        shares.append(-a / (b - a))
    assert shares[::2] == pytest.approx([0.05, 0.25, 0.5, 0.75, 0.95], abs=1e-4)
    assert shares[1::2] == pytest.approx([0.95, 0.75, 0.5, 0.25, 0.05], abs=1e-4)


def test_a_step_is_fastest_half_way_with_the_peak_of_a_minimum_jerk_movement():
    v = STEP.velocity_mm_s(np.arange(0, STEP.move_s, 1e-4))[1] - 0.04
    assert v.max() == pytest.approx(1.875 * 114.56 / STEP.move_s, rel=1e-4)
    assert np.argmax(v) * 1e-4 == pytest.approx(STEP.move_s / 2, abs=2e-4)


def test_a_target_that_leaves_the_screen_is_refused_with_a_remedy():
    check_on_screen(CIRCLE, SCREEN, 4)
    with pytest.raises(DataError, match=r"leaves the screen.*choose a smaller radius"):
        check_on_screen(Circle(150, 143, 50, 200, 40, 20), SCREEN)
    with pytest.raises(DataError, match="leaves the screen: y"):
        check_on_screen(Circle(250, 143, 150, 200), SCREEN)


@pytest.mark.parametrize(
    ("kind", "parameters", "words"),
    [
        ("spiral", {}, "unknown target kind 'spiral'"),
        ("circle", {"radius_mm": 5}, "incomplete"),
        ("tap", {"x_mm": "left", "y_mm": 1}, "not numbers"),
        ("tap", {"x_mm": 1, "y_mm": 1, "z_mm": 1}, "no parameter 'z_mm'"),
    ],
)
def test_odd_parameters_are_named(kind, parameters, words):
    with pytest.raises(DataError, match=words):
        target_from_parameters(kind, parameters)
