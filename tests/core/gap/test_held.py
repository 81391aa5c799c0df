"""Ages of positions that a host's loop holds until its next tick are found and undone."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

from core.sound_sessions import recorded, with_touch
from draglag.gap.streams.evidence import inspect
from draglag.recording import Session, TouchTrace
from draglag.simulation.effects.sample_hold.ages import uneven_age_s


@pytest.fixture(scope="module")
def sound() -> Session:
    return recorded()


def held_at(touch: TouchTrace, period_s: float, begin_s: float = 0.0) -> TouchTrace:
    """What a loop writes that takes the newest event at each tick."""
    tick_s = np.arange(touch.t_s[0] + begin_s + period_s, touch.t_s[-1], period_s)
    newest = np.searchsorted(touch.t_s, tick_s, side="right") - 1
    fresh = tick_s - touch.t_s[newest] < 0.05
    newest, tick_s = newest[fresh], tick_s[fresh]
    return TouchTrace(tick_s, touch.x_mm[newest], touch.y_mm[newest])


@pytest.mark.parametrize("rate_hz", [83, 95, 97.5])  # the last two beat with the frames 5 and 2.5 times a second only
def test_the_age_of_held_positions_is_undone(sound: Session, rate_hz: float) -> None:
    session = with_touch(sound, lambda touch: held_at(touch, 1 / rate_hz))
    (seen,), repaired = inspect(session)
    assert seen.effect == "sample_hold"
    assert seen.value == pytest.approx(rate_hz, rel=1e-3)
    assert seen.undone

    def unevenness_mm(touch: TouchTrace, original: TouchTrace) -> float:
        inner = (touch.t_s > original.t_s[0] + 0.1) & (touch.t_s < original.t_s[-1] - 0.1)
        late_s = [np.interp(touch.t_s[inner] - age, original.t_s, original.x_mm) for age in np.arange(0, 0.012, 5e-4)]
        return min(float(np.median(np.abs(touch.x_mm[inner] - x))) for x in late_s)

    fast = max(range(len(sound.runs)), key=lambda k: sound.runs[k].nominal_speed_mm_s or 0.0)
    original = sound.runs[fast].touch
    before = unevenness_mm(session.runs[fast].touch, original)
    assert unevenness_mm(repaired.runs[fast].touch, original) < before / 5


@pytest.mark.parametrize("rate_hz", [99.5, 99.6])
def test_ages_whose_beat_is_too_slow_are_reported(sound: Session, rate_hz: float) -> None:
    # 100 frames a second: the beat takes more than a hundred ticks; another line must not be taken for it.
    (seen,), _ = inspect(with_touch(sound, lambda touch: held_at(touch, 1 / rate_hz)))
    assert seen.effect == "sample_hold"
    assert not seen.undone


def test_positions_held_by_a_fast_loop_are_even_again(sound: Session) -> None:
    # A tick of 7 ms shows each frame of 10 ms once or twice: first showings alone would be stamps with holes.
    _, repaired = inspect(with_touch(sound, lambda touch: held_at(touch, 1 / 143)))
    for run, original in zip(repaired.runs, sound.runs, strict=True):
        frame_s = float(np.median(np.diff(original.touch.t_s)))
        assert np.mean(np.abs(np.diff(run.touch.t_s) - frame_s) < 0.1 * frame_s) > 0.9


@pytest.mark.parametrize("rate_hz", [133, 251])
def test_positions_held_by_a_fast_loop_are_as_late_in_every_run(sound: Session, rate_hz: float) -> None:
    """Loop and frames begin each run at another phase, which must not become a latency of that run."""
    rng = np.random.default_rng(7)
    sound = replace(sound, runs=sound.runs[:8])
    session = with_touch(sound, lambda touch: held_at(touch, 1 / rate_hz, begin_s=rng.uniform(0, 0.01)))
    _, repaired = inspect(session)
    late_s = []
    for run, original in zip(repaired.runs, sound.runs, strict=True):
        shown_s = dict(zip(zip(original.touch.x_mm, original.touch.y_mm, strict=True), original.touch.t_s, strict=True))
        each = zip(run.touch.t_s, run.touch.x_mm, run.touch.y_mm, strict=True)
        late_s.append(float(np.median([t - shown_s[x, y] for t, x, y in each])))
    # A phase is found to 1/64 of a frame: of 10 ms, 0.05 ms. Ages of first events alone leave it open by 1 to 7 ms.
    assert np.std(late_s) < 1.5e-4


def test_ages_of_frames_that_jitter_each_by_itself_are_undone(sound: Session) -> None:
    """Frames show first in three ticks of four, by ages that change alike: even, as third differences see them."""

    def held(touch: TouchTrace) -> TouchTrace:
        t_s = np.arange(touch.t_s[0], touch.t_s[-1], 1 / 60)
        t_s = t_s + 7e-4 * np.random.default_rng(1).standard_normal(t_s.size)
        x, y = (np.interp(t_s, touch.t_s, values) for values in (touch.x_mm, touch.y_mm))
        return held_at(TouchTrace(t_s, x, y), 1 / 78.3)

    found, _ = inspect(with_touch(replace(sound, runs=sound.runs[:8]), held))
    assert [(one.effect, one.undone) for one in found] == [("sample_hold", True)]


def test_a_fast_loop_is_seen_although_arrivals_jitter(sound: Session) -> None:
    rng = np.random.default_rng(5)

    def held(touch: TouchTrace) -> TouchTrace:
        shown = held_at(touch, 0.004)
        return replace(shown, t_s=shown.t_s + rng.exponential(3e-5, shown.t_s.size))

    assert [one.effect for one in inspect(with_touch(sound, held))[0]] == ["sample_hold"]


def test_stamps_in_pairs_show_no_age_of_positions() -> None:
    """Half of the steps are within a pair, so that the median is none: without even steps nothing is known of ages."""
    frame_s = 0.008
    t_s = np.append(0.0, np.cumsum(np.tile([1e-4, 2 * frame_s, 1e-4, 3 * frame_s], 300)))
    trace = TouchTrace(t_s, 40 * np.cos(8 * t_s), 40 * np.sin(8 * t_s), np.ones(t_s.size, np.int64))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert uneven_age_s([trace]) == 0.0
