"""Events that a host delays, and positions that stand still and leap, on sessions changed by a known amount."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.strokes import even_strokes
from core.sound_sessions import in_steps, recorded, with_touch
from draglag.gap.streams.evidence import inspect
from draglag.gap.streams.stalls import stalls
from draglag.latency.steady import has_constant_speed
from draglag.recording import Session, TouchTrace
from draglag.simulation import LatencyLaw, rig_for_screen


@pytest.fixture(scope="module")
def sound() -> Session:
    return recorded()


def test_stalls_are_reported(sound: Session) -> None:
    def stalled(touch: TouchTrace) -> TouchTrace:
        t_s = touch.t_s.copy()
        for start in np.arange(t_s[0] + 1, t_s[-1] - 1, 3.0):
            held = np.flatnonzero((t_s >= start) & (t_s < start + 0.05))
            t_s[held] = start + 0.05 + 3e-5 * np.arange(held.size)
        return replace(touch, t_s=t_s)

    assert not stalls(sound)
    assert inspect(with_touch(sound, stalled))[0] == ()  # bursts are no frames on one tick of a coarse clock
    assert stalls(with_touch(sound, stalled))


def test_positions_that_stand_still_and_leap_are_a_stall(sound: Session) -> None:
    def frozen(touch: TouchTrace) -> TouchTrace:
        x, y = touch.x_mm.copy(), touch.y_mm.copy()
        for start in np.arange(touch.t_s[0] + 1, touch.t_s[-1] - 1, 2.0):  # 30 a minute, 80 ms each
            held = np.flatnonzero((touch.t_s >= start) & (touch.t_s < start + 0.08))
            x[held], y[held] = x[held[0]], y[held[0]]
        return replace(touch, x_mm=x, y_mm=y)

    assert stalls(with_touch(sound, frozen))


def test_positions_that_are_all_reported_twice_are_no_stall(sound: Session) -> None:
    """Frames of a second contact repeat the position of the first."""

    def of_two(touch: TouchTrace) -> TouchTrace:
        t_s = np.sort(np.concatenate([touch.t_s, touch.t_s + 0.003]))
        return TouchTrace(t_s, np.repeat(touch.x_mm, 2), np.repeat(touch.y_mm, 2))

    assert not stalls(with_touch(sound, of_two))


@pytest.mark.parametrize("lifted", [True, False])
def test_a_leap_to_another_contact_is_no_stall(sound: Session, lifted: bool) -> None:
    """The hand rests at the edge before it is lifted, and lands elsewhere; one contact that does so has stalled."""

    def landing(touch: TouchTrace) -> TouchTrace:
        place = np.arange(touch.t_s.size) % 300 >= 290
        contact = np.arange(touch.t_s.size) // 300 if lifted else np.zeros(touch.t_s.size, np.int64)
        x, y = (np.where(place, 20.0, v) for v in (touch.x_mm, touch.y_mm))
        return TouchTrace(touch.t_s, x, y, contact)

    assert stalls(with_touch(sound, landing)) != lifted


def test_a_hand_that_rests_is_no_stall(sound: Session) -> None:
    """Without noise all positions of a rest are alike, and the first step out of it is a usual one."""

    def resting(touch: TouchTrace) -> TouchTrace:
        since_s = touch.t_s - touch.t_s[0]
        moving_s = touch.t_s[0] + 5.7 * (since_s // 6) + np.minimum(since_s % 6, 5.7)  # rests of 0.3 s
        x, y = (np.interp(moving_s, touch.t_s, values) for values in (touch.x_mm, touch.y_mm))
        return in_steps(replace(touch, x_mm=x, y_mm=y), 0.1)

    assert not stalls(with_touch(sound, resting))


@pytest.mark.parametrize("frozen_s", [0.0, 0.04])
def test_what_a_steep_law_does_at_turns_is_no_stall(sound: Session, frozen_s: float) -> None:
    """Late where the stylus turns, positions of whole steps stand there and leap; frozen ones do so anywhere."""
    rig = replace(rig_for_screen("screen-1"), law=LatencyLaw(300.0, 0.01, 0.0, 0.03, 43.0), noise_mm=0.02)
    run, _ = even_strokes(rig, 350.0, 150.0, turn_s=0.25)
    assert has_constant_speed(run)
    touch = in_steps(run.touch, 0.25)
    for start_s in np.arange(touch.t_s[0] + 0.5, touch.t_s[-1] - 0.5, 0.3333) if frozen_s else ():
        held = np.flatnonzero((touch.t_s >= start_s) & (touch.t_s < start_s + frozen_s))
        touch.x_mm[held], touch.y_mm[held] = touch.x_mm[held[0]], touch.y_mm[held[0]]
    assert stalls(replace(sound, runs=(replace(run, touch=touch),))) == (frozen_s > 0)


def test_a_busy_host_s_jitter_is_no_stall(sound: Session) -> None:
    """Lateness of 0.4 ms with a long tail now and then passes for a pause and an event at once, at 300 a second."""
    rng = np.random.default_rng(5)

    def jittery(touch: TouchTrace) -> TouchTrace:
        even_s = np.arange(touch.t_s[0], touch.t_s[-1], 1 / 300)
        x, y = (np.interp(even_s, touch.t_s, v) for v in (touch.x_mm, touch.y_mm))
        return TouchTrace(np.maximum.accumulate(even_s + rng.gamma(0.8, 4e-4, even_s.size)), x, y)

    busy = with_touch(sound, jittery)
    pauses = [np.diff(run.touch.t_s) for run in busy.runs]
    assert sum(np.count_nonzero((p[:-1] > 6e-3) & (p[1:] < 0.8e-3)) for p in pauses) > 20
    assert not stalls(busy)


def test_the_jitter_of_a_fast_panel_s_host_is_no_stall(sound: Session) -> None:
    # 500 frames a second, one in a hundred 2 ms late and its next at once.
    def late(touch: TouchTrace) -> TouchTrace:
        even_s = np.arange(touch.t_s[0], touch.t_s[-1], 0.002)
        x, y = (np.interp(even_s, touch.t_s, values) for values in (touch.x_mm, touch.y_mm))
        return TouchTrace(even_s + 0.00195 * (np.arange(even_s.size) % 100 == 50), x, y)

    assert not stalls(with_touch(sound, late))
