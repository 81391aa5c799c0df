"""Stamps of touch events that lie on a grid leave the latency open by it, and the estimates say so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.sound_sessions import recorded, with_touch
from draglag.analysis import analyze
from draglag.latency.stamps import COARSE, stamps_reach_s
from draglag.recording import Session, TouchTrace


@pytest.fixture(scope="module")
def sound() -> Session:
    return recorded()


# A hundred frames a second: of ticks of 15.6 and 16.7 ms, as Windows and a display have them, several share a stamp.
@pytest.mark.parametrize("tick_s", [0.001, 0.002, 0.004, 0.008, 0.0156, 1 / 60])
def test_latencies_lie_in_the_intervals_that_coarse_stamps_leave(sound: Session, tick_s: float) -> None:
    def rounded(touch: TouchTrace) -> TouchTrace:
        return replace(touch, t_s=np.floor(touch.t_s / tick_s) * tick_s)

    found, fine = analyze(with_touch(sound, rounded)), analyze(sound)
    known = [(one, other) for one, other in zip(found.runs, fine.runs, strict=True) if other.latency_s is not None]
    assert len(known) >= 10
    inside = 0
    for one, other in known:
        assert COARSE in one.flags
        assert COARSE not in other.flags
        assert one.latency_ci95_s is not None
        assert other.latency_s is not None
        inside += one.latency_ci95_s[0] < other.latency_s < one.latency_ci95_s[1]
    assert inside >= len(known) - 2  # of intervals of 95 %, three of thirteen miss in one case in forty


def test_one_run_on_coarse_stamps_shows_them_among_others_on_fine_ones(sound: Session) -> None:
    one = sound.runs[1]
    coarse = replace(one, touch=replace(one.touch, t_s=np.floor(one.touch.t_s / 0.001) * 0.001))
    found = analyze(replace(sound, runs=tuple(coarse if run is one else run for run in sound.runs)))
    assert [run.id for run in found.runs if COARSE in run.flags] == [one.id]


def test_even_frames_of_which_some_are_missing_are_no_grid_of_stamps() -> None:
    t_s = 0.0075 * np.flatnonzero(np.random.default_rng(3).random(3000) > 0.03)
    assert stamps_reach_s([t_s]) == 0.0


def test_frames_that_jitter_by_microseconds_are_no_grid_of_stamps(sound: Session) -> None:
    assert stamps_reach_s([run.touch.t_s for run in sound.runs]) == 0.0
