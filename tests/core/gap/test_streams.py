"""Stream-level evidence on sessions changed by a known amount, and the acceleration behind a warped trace."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from core.sound_sessions import in_steps, recorded, with_touch
from draglag.gap.correction import realise
from draglag.gap.streams.evidence import inspect
from draglag.gap.streams.stamps import first_of_repeats, resolutions_mm
from draglag.gap.traces.dewarped import DewarpedKinematics, spectrum_of
from draglag.gap.traces.run_data import gather
from draglag.model.file import ModelEffect
from draglag.protocol.runs import load_protocol
from draglag.recording import Session, TouchTrace
from draglag.simulation import simulate_session
from draglag.simulation.effects import parse_effects
from draglag.simulation.effects.base import Edges
from draglag.simulation.effects.laser_bounce import LaserBounce
from draglag.simulation.effects.timestamp_quantisation.stream import evened


@pytest.fixture(scope="module")
def sound() -> Session:
    return recorded()


def test_stamps_as_coarse_as_the_frames_are_not_taken_for_missing_frames(sound: Session) -> None:
    # 100 frames a second on a clock of 8 ms: intervals of 8 and 16 ms, as if a fifth of 125 frames a second were lost.
    found, _ = inspect(with_touch(sound, lambda touch: replace(touch, t_s=np.floor(touch.t_s / 0.008) * 0.008)))
    assert [f.effect for f in found] == ["timestamp_quantisation"]
    assert found[0].value == pytest.approx(0.008, rel=0.01)


@pytest.mark.parametrize("tick_s", [0.016, 0.033])
def test_stamps_coarser_than_the_frames_are_reported_although_some_repeat(sound: Session, tick_s: float) -> None:
    # 100 frames a second, one or two of a stamp or three or four, but no batches of one size.
    found, repaired = inspect(
        with_touch(sound, lambda touch: replace(touch, t_s=np.floor(touch.t_s / tick_s) * tick_s))
    )
    assert [f.effect for f in found] == ["timestamp_quantisation"]
    assert found[0].value == pytest.approx(tick_s, rel=0.01)
    for run, original in zip(repaired.runs, sound.runs, strict=True):  # rounding alone: a twelfth of the tick's square
        assert np.std(run.touch.t_s - original.touch.t_s) < 0.2 * tick_s / np.sqrt(12)


def test_stamps_hardly_coarser_than_the_frames_are_reported_by_the_few_that_repeat(sound: Session) -> None:
    # 100 frames a second on a clock of 10.3 ms: every thirtieth stamp twice.
    found, _ = inspect(with_touch(sound, lambda touch: replace(touch, t_s=np.floor(touch.t_s / 0.0103) * 0.0103)))
    assert [f.effect for f in found] == ["timestamp_quantisation"]
    assert found[0].value == pytest.approx(0.0103, rel=0.01)


def test_coarse_stamps_that_beat_slowly_with_the_frames_are_even_again(sound: Session) -> None:
    # 100 frames a second on a clock of 9.75 ms: the rounding comes round every 39 frames, 2.8 ms in standard deviation.
    _, repaired = inspect(with_touch(sound, lambda touch: replace(touch, t_s=np.floor(touch.t_s / 0.00975) * 0.00975)))
    for run, original in zip(repaired.runs, sound.runs, strict=True):
        jitter_s = np.std(np.diff(original.touch.t_s)[np.diff(original.touch.t_s) < 0.015]) / np.sqrt(2)
        assert np.std(run.touch.t_s - original.touch.t_s) < 1.5 * jitter_s + 5e-5


def test_coarse_stamps_of_frames_whose_rate_wanders_follow_it() -> None:
    # 100 frames a second, a thousandth more or less within 40 s, on a clock of 1 ms that all but keeps step with them.
    count = np.arange(4000)
    true_s = 3.1 + 0.01 * count + 1e-3 * np.cumsum(0.01 * np.sin(2 * np.pi * count / 4000))
    true_s = true_s + np.random.default_rng(0).normal(0, 1e-4, count.size)
    even = evened(TouchTrace(np.floor(true_s / 1e-3) * 1e-3, 0.0 * count, 0.0 * count), 1e-3)
    off_s = even.t_s - true_s
    assert np.std(off_s) < 3e-4  # as far as rounding alone scatters


def test_missing_frames_on_a_clock_hardly_coarser_than_they_are_both_reported(sound: Session) -> None:
    # 100 frames a second, every seventh lost, on a clock of 10.3 ms.
    def lossy(touch: TouchTrace) -> TouchTrace:
        keep = np.random.default_rng(4).random(touch.t_s.size) > 1 / 7
        t_s = np.floor(touch.t_s[keep] / 0.0103) * 0.0103
        return TouchTrace(t_s, touch.x_mm[keep], touch.y_mm[keep])

    found, _ = inspect(with_touch(sound, lossy))
    assert [f.effect for f in found] == ["timestamp_quantisation", "frame_drop"]
    low, high = found[1].ci95
    assert low < 1 / 7 < high
    assert not found[0].undone  # which frame a stamp is of is not sure: no effect of the acceleration will be named


def test_missing_frames_of_an_even_clock_are_not_taken_for_coarse_stamps(sound: Session) -> None:
    def thinned(touch: TouchTrace) -> TouchTrace:
        even_s = touch.t_s[0] + 0.01 * np.arange(touch.t_s.size)
        keep = np.random.default_rng(4).random(touch.t_s.size) > 0.2
        x, y = (np.interp(even_s, touch.t_s, values)[keep] for values in (touch.x_mm, touch.y_mm))
        return TouchTrace(np.round(even_s[keep], 6), x, y)

    found, _ = inspect(with_touch(sound, thinned))
    assert [f.effect for f in found] == ["frame_drop"]
    assert found[0].value == pytest.approx(0.2, abs=0.02)


def test_the_share_of_missing_frames_counts_long_bursts_too(sound: Session) -> None:
    # Of the frames 30 % are lost, two at a time in the mean, some bursts longer than six.
    rng = np.random.default_rng(5)

    def in_bursts(touch: TouchTrace) -> TouchTrace:
        keep = np.ones(touch.t_s.size, bool)
        at = 0
        while at < keep.size:
            at += rng.geometric(0.5 * 0.3 / 0.7)
            burst = rng.geometric(0.5)
            keep[at : at + burst] = False
            at += burst
        return TouchTrace(touch.t_s[keep], touch.x_mm[keep], touch.y_mm[keep])

    lossy = with_touch(sound, in_bursts)
    left = sum(run.touch.t_s.size for run in lossy.runs) / sum(run.touch.t_s.size for run in sound.runs)
    found = next(f for f in inspect(lossy)[0] if f.effect == "frame_drop")
    assert found.value == pytest.approx(1 - left, rel=0.01)  # of this session's own frames
    low, high = found.ci95
    assert low < 0.3 < high


def with_chatter(session: Session, span_s: float) -> Session:
    """Half of the edges chatter, as the simulation has it."""
    bounce, rng = LaserBounce(0.5, span_s), np.random.default_rng(11)
    runs = []
    for run in session.runs:
        edges = bounce.edges(Edges(run.laser.t_s, run.laser.light), rng)
        order = np.argsort(edges.t_s)
        laser = replace(run.laser, t_s=edges.t_s[order], light=edges.light[order])
        runs.append(replace(run, laser=laser))
    return replace(session, runs=tuple(runs))


@pytest.mark.parametrize("span_s", [8e-4, 4e-3])
def test_chatter_is_reported_by_the_time_it_may_last_and_by_its_share(sound: Session, span_s: float) -> None:
    (found,), _ = inspect(with_chatter(sound, span_s))
    assert found.effect == "laser_bounce"
    for name, truth in (("span_s", span_s), ("share", 0.5)):
        value, (low, high) = found.parameters[name]
        assert low <= value <= high
        assert low < truth < high, name


def test_an_edge_next_to_another_that_chatters_is_no_longer_chatter(sound: Session) -> None:
    noisy = with_chatter(sound, 8e-4)
    first, *others = noisy.runs
    laser, at_s = first.laser, float(np.median(first.laser.t_s)) + 5e-3
    t_s = np.append(laser.t_s, at_s + np.array([0.0, 2e-4, 1.1e-3]))  # a pass that grazes the beam, and chatters
    order = np.argsort(t_s)
    light = np.append(laser.light, [1 - laser.light[-1], laser.light[-1], 1 - laser.light[-1]]).astype(
        laser.light.dtype
    )
    grazed = replace(first, laser=replace(laser, t_s=t_s[order], light=light[order]))
    (found,), _ = inspect(replace(noisy, runs=(grazed, *others)))
    low, high = found.parameters["span_s"][1]
    assert low < 8e-4 < high


def test_chatter_that_no_run_shows_whole_is_reported_as_far_as_it_is_seen(sound: Session) -> None:
    # A thin stylus and quick circles: passes are hardly longer than the chatter, which falls apart there.
    thin = replace(sound, stylus=replace(sound.stylus, diameter_mm=3.0))
    quick = replace(thin, runs=tuple(run for run in thin.runs if (run.nominal_speed_mm_s or 0.0) > 190.0))
    (found,), _ = inspect(with_chatter(quick, 5e-3))
    low, high = found.parameters["share"][1]
    assert low < 0.5 <= high
    reported = {name: float(value) for name, (value, _) in found.parameters.items()}
    made = realise(ModelEffect(id=found.effect, parameters=reported))
    assert made == LaserBounce(reported["share"], reported["span_s"])
    # A model file without the share has a chatter of the usual share, not one of a share of so many seconds.
    assert realise(ModelEffect(id=found.effect, parameters={"span_s": 0.004})) == LaserBounce(0.1, 0.004)


def test_losses_of_contact_are_reported_per_time_of_contact(sound: Session) -> None:
    # 60 a minute of contact, 200 ms each: a sixth of the time is lost.
    rng = np.random.default_rng(6)

    def filled(touch: TouchTrace) -> TouchTrace:
        t_s = touch.t_s
        lost, at_s = np.zeros(t_s.size, bool), t_s[0] + 0.2
        while (at_s := at_s + rng.exponential(1.0)) < t_s[-1] - 0.3:
            lost |= (t_s > at_s) & (t_s < at_s + 0.2)
            at_s += 0.2
        x, y = (np.interp(t_s, t_s[~lost], values[~lost]) for values in (touch.x_mm, touch.y_mm))
        return replace(touch, x_mm=x, y_mm=y)

    found = next(f for f in inspect(with_touch(sound, filled))[0] if f.effect == "loss_of_contact")
    low, high = found.ci95
    assert low < 60 < high
    assert high < 75


@pytest.mark.parametrize("by_count", [False, True])
def test_straight_fills_are_counted_although_stamps_jitter(sound: Session, by_count: bool) -> None:
    """Fills are even in time, or from event to event."""
    rng = np.random.default_rng(8)

    def filled(touch: TouchTrace) -> TouchTrace:
        t_s = touch.t_s + rng.uniform(-2e-4, 2e-4, touch.t_s.size)
        lost = np.zeros(t_s.size, bool)
        for start in np.arange(t_s[0] + 1, t_s[-1] - 1, 3.0):  # 20 a minute, 100 ms each
            lost |= (t_s > start) & (t_s < start + 0.1)
        at = np.arange(t_s.size) if by_count else t_s
        x, y = (np.interp(at, at[~lost], values[~lost]) for values in (touch.x_mm, touch.y_mm))
        return replace(touch, t_s=t_s, x_mm=x, y_mm=y)

    found, repaired = inspect(with_touch(sound, filled))
    assert [f.effect for f in found] == ["loss_of_contact"]
    assert found[0].value == pytest.approx(20, rel=0.15)
    assert all(new.touch.t_s.size < old.touch.t_s.size for new, old in zip(repaired.runs, sound.runs, strict=True))


@pytest.mark.parametrize("step_mm", [0.1, 0.25, 0.5])
def test_coordinates_in_whole_steps_are_neither_held_nor_filled(sound: Session, step_mm: float) -> None:
    # A slow drag stays on one step for several events, and goes on in a line of them.
    assert inspect(with_touch(sound, lambda touch: in_steps(touch, step_mm)))[0] == ()


@pytest.mark.parametrize(("along_mm", "across_mm"), [(0.1, 0.056), (0.5, 0.28), (0.28, 0.5), (0.5, 0.3)])
def test_steps_of_another_size_in_each_coordinate_are_no_fills(
    sound: Session, along_mm: float, across_mm: float
) -> None:
    """Panels have as many counts along their longer side as along the shorter: no step of one is whole in the other."""
    assert inspect(with_touch(sound, lambda touch: in_steps(touch, along_mm, across_mm)))[0] == ()


@pytest.mark.parametrize("jitter", [0.0, 0.05])
def test_frames_in_which_nothing_changed_are_neither_lost_nor_badly_stamped(sound: Session, jitter: float) -> None:
    """A kernel sends no report of them, and a slow stylus stays on one step of 1 mm for several."""
    rng = np.random.default_rng(5)

    def sent(touch: TouchTrace) -> TouchTrace:
        late_s = rng.normal(0.0, jitter * np.median(np.diff(touch.t_s)), touch.t_s.size)
        return first_of_repeats(in_steps(replace(touch, t_s=touch.t_s + late_s), 1.0))

    slow = with_touch(sound, sent)
    assert sum(run.touch.t_s.size for run in slow.runs) < 0.95 * sum(run.touch.t_s.size for run in sound.runs)
    assert inspect(slow)[0] == ()


def test_fills_are_seen_in_whole_steps_finer_than_the_noise(sound: Session) -> None:
    rng = np.random.default_rng(3)

    def filled(touch: TouchTrace) -> TouchTrace:
        t_s = touch.t_s
        lost = np.zeros(t_s.size, bool)
        for start in np.arange(t_s[0] + 1, t_s[-1] - 1, 6.0):  # 10 a minute, 250 ms each
            lost |= (t_s > start) & (t_s < start + 0.25)
        noisy = [values + rng.normal(0, 0.15, t_s.size) for values in (touch.x_mm, touch.y_mm)]
        x, y = (np.interp(t_s, t_s[~lost], values[~lost]) for values in noisy)
        return in_steps(replace(touch, x_mm=x, y_mm=y), 0.1)

    found, _ = inspect(with_touch(sound, filled))
    assert [f.effect for f in found] == ["loss_of_contact"]
    assert found[0].value == pytest.approx(10, rel=0.2)


@pytest.mark.parametrize("step_mm", [0.002, 0.1])
def test_fills_are_seen_that_are_made_after_rounding(sound: Session, step_mm: float) -> None:
    """Their positions lie between the steps of all others."""

    def filled(touch: TouchTrace) -> TouchTrace:
        whole, t_s = in_steps(touch, step_mm), touch.t_s
        lost = np.zeros(t_s.size, bool)
        for start in np.arange(t_s[0] + 1, t_s[-1] - 1, 3.0):  # 20 a minute, 150 ms each
            lost |= (t_s > start) & (t_s < start + 0.15)
        x, y = (np.interp(t_s, t_s[~lost], values[~lost]) for values in (whole.x_mm, whole.y_mm))
        return replace(whole, x_mm=x, y_mm=y)

    found, _ = inspect(with_touch(sound, filled))
    assert [f.effect for f in found] == ["loss_of_contact"]
    assert found[0].value == pytest.approx(20, rel=0.15)
    steps_mm = resolutions_mm([filled(run.touch) for run in sound.runs])
    assert steps_mm == pytest.approx((step_mm, step_mm), rel=0.01)


@pytest.mark.parametrize("step_mm", [0.002, 0.005])
def test_lines_that_a_smooth_path_makes_on_fine_steps_are_no_fills(sound: Session, step_mm: float) -> None:
    """On so fine steps nearly all coordinates differ, and slow parts of a low-passed path bend by less than one."""

    def smooth(touch: TouchTrace) -> TouchTrace:
        even = touch.t_s[0] + np.arange(touch.t_s.size) / 120
        x, y = (gaussian_filter1d(np.interp(even, touch.t_s, v), 12) for v in (touch.x_mm, touch.y_mm))
        return in_steps(replace(touch, t_s=even, x_mm=x, y_mm=y), step_mm)

    assert "loss_of_contact" not in {f.effect for f in inspect(with_touch(sound, smooth))[0]}


def test_a_ripple_is_no_uneven_age_of_even_stamps(sound: Session) -> None:
    def rippled(touch: TouchTrace) -> TouchTrace:
        even = touch.t_s[0] + np.arange(touch.t_s.size) * float(np.mean(np.diff(touch.t_s)))
        y = np.interp(even, touch.t_s, touch.y_mm)
        return replace(touch, t_s=even, x_mm=np.interp(even, touch.t_s, touch.x_mm), y_mm=y + 0.4 * np.sin(1.2 * y))

    assert "sample_hold" not in {f.effect for f in inspect(with_touch(sound, rippled))[0]}


def test_bursts_after_stalls_are_neither_fills_of_whole_steps_nor_missing_frames(sound: Session) -> None:
    def stalled(touch: TouchTrace) -> TouchTrace:
        t_s = touch.t_s.copy()
        for start in np.arange(t_s[0] + 1, t_s[-1] - 1, 0.5):
            t_s[(t_s >= start) & (t_s < start + 0.04)] = start + 0.04
        noise = np.random.default_rng(6).normal(0, 0.05, (2, t_s.size))
        return in_steps(replace(touch, t_s=t_s, x_mm=touch.x_mm + noise[0], y_mm=touch.y_mm + noise[1]), 0.3)

    assert inspect(with_touch(sound, stalled))[0] == ()


@pytest.mark.parametrize("window_s", [0.03, 0.07])
def test_the_acceleration_behind_a_trace_that_it_warps_is_given_back(window_s: float) -> None:
    # A stylus at 800 mm/s whose speed varies at 2.5 Hz, reported with 10 µs per mm/s² more latency, the acceleration
    # taken of a speed smoothed over a window: exact, no fits.
    t_s = np.arange(0, 12, 1e-3)
    rate, swing, lag = 2 * np.pi * 2.5, 30.0, 1e-5
    path_mm = 800 * t_s - swing / rate * np.cos(rate * t_s)
    reported = swing * rate * np.exp(-0.5 * (rate * window_s) ** 2)  # its amplitude, mm/s²
    shown_s = t_s + 0.03 + lag * reported * np.cos(rate * t_s)
    grid_s = np.arange(0.5, 11.5, 0.004)
    speed = np.gradient(np.interp(grid_s, shown_s, path_mm), grid_s)
    run = SimpleNamespace(spectrum=spectrum_of((grid_s, speed), 800.0))
    at_s = np.arange(2.0, 10.0, 0.013)
    edges = DewarpedKinematics((run,), np.zeros(at_s.size, int), at_s + 0.03)  # type: ignore[arg-type]
    accel, _ = edges.acceleration(lag, window_s)
    truth = reported * np.cos(rate * at_s)
    raw, _ = edges.acceleration(0.0, window_s)
    assert np.std(raw - truth) > 0.5 * np.std(truth)
    # To first order: the acceleration moves an edge by up to 5 ms of the 64 ms in which it turns by one radian.
    assert np.std(accel - truth) < 0.1 * np.std(truth)


def test_the_acceleration_of_a_hand_at_3_hz_is_not_flattened_by_windows() -> None:
    # On a circle at 400 mm/s whose speed varies by 5 % at 3 Hz, with the noise of a simulated panel.
    session = simulate_session("screen-2", load_protocol("demo"), seed=3)
    data = next(data for data in gather(session) if data.run.protocol == "multisine")
    t_s = data.t_s - data.t_s[0]
    rate, radius_mm = 2 * np.pi * 3.0, 50.0
    angle = (400 * t_s - 20 / rate * np.cos(rate * t_s)) / radius_mm
    noise_mm = np.random.default_rng(7).normal(0, data.noise_mm, (2, t_s.size))
    xy_mm = radius_mm * np.column_stack([np.cos(angle), np.sin(angle)]) + noise_mm.T
    run = replace(data, xy_mm=xy_mm)
    at_s = np.arange(2.0, t_s[-1] - 2.0, 0.013)
    accel, _ = DewarpedKinematics((run,), np.zeros(at_s.size, int), data.t_s[0] + at_s).acceleration(0.0, 0.0)
    # The size of a lag is inverse to the slope.
    slope = np.polyfit(20 * rate * np.cos(rate * at_s), accel, 1)[0]
    assert slope == pytest.approx(1.0, abs=0.15), slope


def test_two_frames_on_each_tick_of_an_exact_clock_are_no_batch(sound: Session) -> None:
    # At 100 Hz nearly, not always, two frames fall on one tick.
    quantum_s = 0.0193
    session = with_touch(sound, lambda touch: replace(touch, t_s=quantum_s * np.floor(touch.t_s / quantum_s)))
    (seen,) = inspect(session)[0]
    assert seen.effect == "timestamp_quantisation"
    assert seen.value == pytest.approx(quantum_s, rel=0.01)


@pytest.mark.parametrize(
    "effects", [("frame_drop=0.15", "loss_of_contact=20", "laser_bounce=0.3"), ("poll_grid=0.008",)]
)
def test_values_and_intervals_print_as_plain_numbers(effects: tuple[str, ...]) -> None:
    session = simulate_session("screen-1", load_protocol("demo"), effects=parse_effects(effects), seed=4)
    found, _ = inspect(session)
    assert {one.effect for one in found} == {text.partition("=")[0] for text in effects}
    for one in found:
        assert "float64" not in repr(one.parameters)  # of NumPy, whose values name their type


def test_fills_are_seen_in_positions_of_uneven_age_and_only_where_they_are() -> None:
    def seen(*effects: str) -> dict[str, float]:
        session = simulate_session("screen-1", load_protocol("demo"), effects=parse_effects(effects), seed=5)
        return {found.effect: found.value for found in inspect(session)[0]}

    both = seen("sample_hold=80", "loss_of_contact=24")
    assert set(both) == {"sample_hold", "loss_of_contact"}
    assert both["loss_of_contact"] == pytest.approx(24, rel=0.25)  # some fills are shorter than four stamps
    assert set(seen("sample_hold=80")) == {"sample_hold"}
