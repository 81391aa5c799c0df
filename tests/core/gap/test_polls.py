"""A host's polling is seen in the stamps, apart from clocks that round, frames that are lost and loops that hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.sound_sessions import recorded, with_touch
from draglag.gap.streams.evidence import inspect
from draglag.recording import FloatArray, Session, TouchTrace
from draglag.simulation.effects import parse_effect
from draglag.simulation.effects.base import TouchEvents


@pytest.fixture(scope="module")
def sound() -> Session:
    whole = recorded()
    return replace(whole, runs=whole.runs[:6])


def at_rate(touch: TouchTrace, rate_hz: float, jitter: float = 0.03) -> TouchTrace:
    """The run seen by a panel of another rate, whose frames jitter by a share of their interval."""
    t_s = np.arange(touch.t_s[0], touch.t_s[-1], 1 / rate_hz)
    t_s = t_s + jitter / rate_hz * np.random.default_rng(1).standard_normal(t_s.size).clip(-3, 3)
    x, y = (np.interp(t_s, touch.t_s, values) for values in (touch.x_mm, touch.y_mm))
    noise = np.random.default_rng(2).normal(0, 0.05, (2, t_s.size))
    return TouchTrace(t_s, x + noise[0], y + noise[1], np.zeros(t_s.size, np.int64))


def after(touch: TouchTrace, *texts: str) -> TouchTrace:
    events = TouchEvents(touch.t_s, touch.x_mm, touch.y_mm, np.zeros(touch.t_s.size, np.int64))
    for text in texts:
        events = parse_effect(text).events(events, np.random.default_rng(7))
    return TouchTrace(events.t_s, events.x_mm, events.y_mm, events.contact_id)


@pytest.mark.parametrize(
    ("rate_hz", "period_s"), [(100, 0.008), (133, 0.008), (240, 0.008), (120, 0.004), (240, 0.0025), (60, 0.012)]
)
def test_a_poll_is_named_with_its_period_and_jitter(sound: Session, rate_hz: float, period_s: float) -> None:
    found, _ = inspect(with_touch(sound, lambda touch: after(at_rate(touch, rate_hz), f"poll_grid={period_s}")))
    assert [f.effect for f in found] == ["poll_grid"]
    for name, truth in (("period_s", period_s), ("jitter_s", 4e-5)):
        value, (low, high) = found[0].parameters[name]
        assert low <= value <= high
        assert low < truth < high, name


def test_a_poll_is_seen_although_contact_is_lost_now_and_then(sound: Session) -> None:
    def lossy(touch: TouchTrace) -> TouchTrace:
        polled = after(at_rate(touch, 133), "poll_grid=0.008")
        lost = np.mod(polled.t_s, 4.0) < 0.1
        return TouchTrace(polled.t_s[~lost], polled.x_mm[~lost], polled.y_mm[~lost])

    assert [f.effect for f in inspect(with_touch(sound, lossy))[0]] == ["poll_grid"]


@pytest.mark.parametrize(("rate_hz", "period_s"), [(60, 0.016), (133, 0.008)])
def test_a_poll_is_seen_although_single_frames_are_lost(sound: Session, rate_hz: float, period_s: float) -> None:
    def lossy(touch: TouchTrace) -> TouchTrace:
        frames = at_rate(touch, rate_hz)
        kept = np.random.default_rng(3).uniform(size=frames.t_s.size) > 0.006  # some fill what the beat leaves empty
        return after(TouchTrace(frames.t_s[kept], frames.x_mm[kept], frames.y_mm[kept]), f"poll_grid={period_s}")

    assert [f.effect for f in inspect(with_touch(sound, lossy))[0]] == ["poll_grid"]


def test_polls_slower_than_the_frames_are_named_although_the_stylus_rests_in_one_run(sound: Session) -> None:
    def newest(touch: TouchTrace) -> TouchTrace:
        frames = at_rate(touch, 166)
        tick = np.ceil(frames.t_s / 0.008)
        keep = np.append(np.diff(tick) > 0, True)  # one report a poll: an older one is written over
        late_s = np.random.default_rng(4).exponential(4e-5, np.count_nonzero(keep))
        return TouchTrace(0.008 * tick[keep] + late_s, frames.x_mm[keep], frames.y_mm[keep])

    moving = with_touch(sound, newest)
    last = moving.runs[-1].touch
    rests = last.t_s > np.quantile(last.t_s, 0.95)  # positions repeat there, and nothing holds them
    resting = replace(
        last, x_mm=np.where(rests, last.x_mm[-1], last.x_mm), y_mm=np.where(rests, last.y_mm[-1], last.y_mm)
    )
    for runs in (moving.runs, (*moving.runs[:-1], replace(moving.runs[-1], touch=resting))):
        found, _ = inspect(replace(moving, runs=runs))
        assert [(f.effect, f.rivals) for f in found] == [("poll_grid", ("sample_hold",))]


def test_positions_that_rest_on_a_panel_of_fairly_even_frames_are_no_loop(sound: Session) -> None:
    """Its intervals differ by one per cent, four times as much as those of a loop: a deadband repeats positions."""

    def rests(touch: TouchTrace) -> TouchTrace:
        own = at_rate(touch, 120, 0.006)
        still = np.random.default_rng(5).uniform(size=own.t_s.size) < 0.05
        kept = np.maximum.accumulate(np.where(still, 0, np.arange(own.t_s.size)))
        return replace(own, x_mm=own.x_mm[kept], y_mm=own.y_mm[kept])

    assert "sample_hold" not in [f.effect for f in inspect(with_touch(sound, rests))[0]]


@pytest.mark.parametrize("rate_hz", [100, 133, 240])
def test_frames_have_their_own_times_again(sound: Session, rate_hz: float) -> None:
    waited = with_touch(sound, lambda touch: after(at_rate(touch, rate_hz), "poll_grid=0.008"))
    found, repaired = inspect(waited)
    assert found[0].undone
    for run, polled, original in zip(repaired.runs, waited.runs, sound.runs, strict=True):
        frames_s: FloatArray = at_rate(original.touch, rate_hz).t_s
        wait_s = polled.touch.t_s - frames_s
        assert np.std(wait_s) == pytest.approx(0.008 / np.sqrt(12), rel=0.1)
        off_s = run.touch.t_s - frames_s
        assert np.std(off_s) < 0.03 / rate_hz + 2e-4  # the frames' own jitter stays
        assert np.mean(off_s) == pytest.approx(np.mean(wait_s), abs=2e-5)  # the mean wait is a latency


@pytest.mark.parametrize(
    ("texts", "named", "jitter"),
    [
        (("timestamp_quantisation=0.008",), ["timestamp_quantisation"], 0.03),
        (("frame_batching=2",), ["frame_batching"], 0.003),
        (("frame_batching=3",), ["frame_batching"], 0.03),
        (("frame_batching=5",), ["frame_batching"], 0.003),  # as even as polls of five frames
        (("frame_drop=0.15",), ["frame_drop"], 0.003),
        (("frame_drop=0.15",), ["frame_drop"], 0.03),
        (("sample_hold=80",), ["sample_hold"], 0.03),
        (("sample_hold=250",), ["sample_hold"], 0.03),
        (("poll_grid=0.001",), [], 0.03),  # as every USB host does: part of any latency
        ((), [], 0.003),
    ],
)
def test_what_else_shapes_stamps_is_no_poll(
    sound: Session, texts: tuple[str, ...], named: list[str], jitter: float
) -> None:
    found, _ = inspect(with_touch(sound, lambda touch: after(at_rate(touch, 133, jitter), *texts)))
    assert [f.effect for f in found] == named


def wandering(touch: TouchTrace, rate_hz: float, jitter: float) -> TouchTrace:
    """The run seen by a panel whose next frame starts from the last one: the jitter of its intervals adds up."""
    rng = np.random.default_rng(3)
    n = int((touch.t_s[-1] - touch.t_s[0]) * rate_hz)
    t_s = touch.t_s[0] + np.cumsum(1 + jitter * rng.standard_normal(n)) / rate_hz
    x, y = (np.interp(t_s, touch.t_s, values) for values in (touch.x_mm, touch.y_mm))
    noise = rng.normal(0, 0.05, (2, n))
    return TouchTrace(t_s, x + noise[0], y + noise[1], np.zeros(n, np.int64))


@pytest.mark.parametrize(
    ("rate_hz", "jitter", "known"), [(62, 0.0, True), (90, 0.005, True), (62, 0.03, False), (133, 0.01, False)]
)
def test_ages_are_stated_as_known_only_where_frames_keep_their_phase(
    sound: Session, rate_hz: float, jitter: float, known: bool
) -> None:
    held = with_touch(sound, lambda touch: after(wandering(touch, rate_hz, jitter), "sample_hold=100"))
    assert [(f.effect, f.undone) for f in inspect(held)[0]] == [("sample_hold", known)]
