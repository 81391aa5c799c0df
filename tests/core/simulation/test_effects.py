"""Every effect does what its sentence says, and nothing else; effects compose and are parsed with plain errors."""

from dataclasses import replace

import numpy as np
import pytest

from draglag.errors import DataError
from draglag.protocol.runs import expand, load_protocol
from draglag.simulation import Human, follow, rig_for_screen, simulate_run_with_truth, simulate_taps
from draglag.simulation.digitiser import reporting
from draglag.simulation.effects import EFFECTS, parse_effect, parse_effects
from draglag.simulation.effects.base import TouchEvents
from draglag.simulation.kinematics import Kinematics, Motion, grid, motion_of
from draglag.simulation.sensor import shadow_edges

RIG = rig_for_screen("screen-1")
IDEAL = RIG.ideal()
PLANNED = {p.kind + str(round(p.nominal_speed_mm_s or 0)): p for p in expand(load_protocol("demo"), RIG.screen)}
IDS = [
    "clock_drift",
    "clock_offset",
    "low_speed_plateau",
    "sample_hold",
    "laser_hysteresis",
    "beam_width",
    "laser_bounce",
    "spatial_warp",
    "scale_error",
    "direction_asymmetry",
    "acceleration_lag",
    "contact_trail",
    "thermal_drift",
    "frame_batching",
    "timestamp_quantisation",
    "frame_drop",
    "loss_of_contact",
    "second_filter_mode",
    "scan_skew",
    "pitch_ripple",
    "smoothing_shrink",
    "beam_wedge",
    "lagging_law",
    "speed_adaptive_filter",
    "prediction",
    "deadband",
    "warm_up",
    "beam_bow",
    "poll_grid",
]
ON_LASER = {"clock_drift", "clock_offset", "laser_hysteresis", "beam_width", "laser_bounce", "beam_wedge", "beam_bow"}


def _rng(name=""):
    return np.random.default_rng(5)


def _run(effects=(), rig=IDEAL, which="circle240"):
    planned = PLANNED[which]
    motion = follow(planned.target, Human(), np.random.default_rng(1))
    return simulate_run_with_truth(
        rig,
        motion,
        run_id=planned.id,
        planned=planned,
        start_s=1000.0,
        rng=np.random.default_rng(2),
        effects=effects,
        session_start_s=100.0,
    )


def _kinematics(motion: Motion):
    return Kinematics(motion, motion.t_s + 900.0, RIG.screen.width_mm, RIG.screen.height_mm)


def _reports(text, which="chirp0"):
    """(kinematics, without, with) of what the digitiser reports."""
    k = _kinematics(follow(PLANNED[which].target, Human(), np.random.default_rng(1)))
    return k, reporting(IDEAL, k, (), _rng), reporting(IDEAL, k, (parse_effect(text),), _rng)


def _straight(vx=0.0, vy=100.0, x0=250.0, y0=50.0, duration=1.5):
    t = grid(duration)
    return motion_of(t, x0 + vx * t, y0 + vy * t, np.ones(len(t), bool))


def test_the_library_has_every_id_of_the_design_in_its_order():
    assert list(EFFECTS) == IDS


@pytest.mark.parametrize("name", IDS)
def test_every_effect_explains_itself(name):
    cls = EFFECTS[name]
    assert cls.meaning.endswith(".")
    assert len(cls.meaning.split()) > 4
    effect = cls.typical()
    assert list(effect.numbers()) == [p.name for p in cls.parameters]
    assert effect.value == cls.parameters[0].typical
    for p in cls.parameters:
        assert p.lower <= p.typical <= p.upper


@pytest.mark.parametrize("name", IDS)
def test_an_effect_changes_its_own_stream_and_leaves_the_other_alone(name):
    plain, before = _run(rig=RIG, which="chirp0")
    run, after = _run((EFFECTS[name].typical(),), rig=RIG, which="chirp0")
    laser_same = np.array_equal(plain.laser.t_s, run.laser.t_s)
    touch_same = all(np.array_equal(getattr(plain.touch, a), getattr(run.touch, a)) for a in ("t_s", "x_mm", "y_mm"))
    assert laser_same == (name not in ON_LASER)
    assert touch_same == (name in ON_LASER)
    if name not in {"beam_width", "beam_wedge", "beam_bow"}:
        assert np.array_equal(before.edge_s, after.edge_s)


@pytest.mark.parametrize("name", IDS)
def test_an_effect_is_reproducible(name):
    (one, _), (two, _) = (_run((EFFECTS[name].typical(),), rig=RIG) for _ in range(2))
    assert np.array_equal(one.touch.y_mm, two.touch.y_mm)
    assert np.array_equal(one.laser.t_s, two.laser.t_s)


def test_all_effects_together_still_give_a_recording():
    run, _ = _run([cls.typical() for cls in EFFECTS.values()], rig=RIG, which="chirp0")
    assert np.isfinite(run.touch.x_mm).all()
    assert (np.diff(run.touch.t_s) >= 0).all()
    assert (np.diff(run.laser.t_s) >= 0).all()


def test_effects_of_different_kinds_add_up():
    plain, _ = _run()
    both, _ = _run(parse_effects(["clock_offset=0.003", "scale_error=0.01"]))
    one, _ = _run(parse_effects(["clock_offset=0.003"]))
    other, _ = _run(parse_effects(["scale_error=0.01"]))
    assert np.array_equal(both.laser.t_s, one.laser.t_s)
    assert np.array_equal(both.touch.y_mm, other.touch.y_mm)
    assert not np.array_equal(both.touch.y_mm, plain.touch.y_mm)
    k, without, skew = _reports("scan_skew=0.01")
    two = reporting(IDEAL, k, parse_effects(["scan_skew=0.01", "thermal_drift=0.1"]), _rng)
    assert two.latency_s - without.latency_s == pytest.approx(skew.latency_s - without.latency_s + k.session_s / 36000)


# what the latency effects do


def test_plateau_holds_the_latency_below_its_speed():
    k, without, now = _reports("low_speed_plateau=125")
    slow = k.speed_mm_s < 125
    assert 0 < slow.sum() < len(slow)
    assert now.latency_s[slow] == pytest.approx(float(RIG.law.latency_s(125.0)))
    assert np.array_equal(now.latency_s[~slow], without.latency_s[~slow])


def test_lagging_law_uses_the_speed_of_before():
    _, without, now = _reports("lagging_law=0.04")
    assert now.latency_s[40:] == pytest.approx(without.latency_s[:-40])


def test_acceleration_lag_follows_the_change_of_speed():
    t = grid(1.0)
    motion = motion_of(t, 100 + 0 * t, 50 + 50 * t + 250 * t**2, np.ones(len(t), bool))
    k = _kinematics(motion)
    extra = (
        reporting(IDEAL, k, (parse_effect("acceleration_lag=2e-6"),), _rng).latency_s
        - reporting(IDEAL, k, (), _rng).latency_s
    )
    assert extra[5:-5] == pytest.approx(2e-6 * 500, rel=1e-3)


def test_direction_asymmetry_is_positive_downwards():
    k, without, now = _reports("direction_asymmetry=0.006")
    extra = now.latency_s - without.latency_s
    assert extra[k.motion.vy_mm_s > 0] == pytest.approx(0.003)
    assert extra[k.motion.vy_mm_s < 0] == pytest.approx(-0.003)


def test_thermal_drift_creeps_for_drags_and_taps():
    k, without, now = _reports("thermal_drift=0.036")
    assert now.latency_s - without.latency_s == pytest.approx(1e-5 * k.session_s)
    taps, warm = (
        simulate_taps(RIG, 50, start_s=3700.0, rng=_rng(), effects=e, session_start_s=100.0)
        for e in ((), (parse_effect("thermal_drift=0.036"),))
    )
    assert warm.registered_s - taps.registered_s == pytest.approx(1e-5 * (taps.physical_s - 100), abs=2e-6)


def test_warm_up_fades_for_drags_and_taps():
    k, without, now = _reports("warm_up=0.012,time_constant_s=400")
    assert now.latency_s - without.latency_s == pytest.approx(0.012 * np.exp(-k.session_s / 400))
    taps, warm = (
        simulate_taps(RIG, 50, start_s=350.0, rng=_rng(), effects=e, session_start_s=100.0)
        for e in ((), (parse_effect("warm_up=0.012,time_constant_s=400"),))
    )
    extra = 0.012 * np.exp(-(taps.physical_s - 100) / 400)
    assert warm.registered_s - taps.registered_s == pytest.approx(extra, abs=2e-6)


def test_second_filter_mode_switches_at_its_threshold():
    k, without, now = _reports("second_filter_mode=0.006,threshold_mm_s=200")
    extra = now.latency_s - without.latency_s
    assert extra == pytest.approx(np.where(k.speed_mm_s > 200, 0.006, 0.0))


def test_scan_skew_grows_from_left_to_right():
    k = _kinematics(_straight(vx=509.2, vy=0.0, x0=0.0, y0=100.0, duration=1.0))
    extra = (
        reporting(IDEAL, k, (parse_effect("scan_skew=0.008"),), _rng).latency_s
        - reporting(IDEAL, k, (), _rng).latency_s
    )
    assert extra[[0, -1]] == pytest.approx([-0.004, 0.004])
    assert np.diff(extra) == pytest.approx(0.008 / 1000)


# what the position effects do


def test_contact_trail_is_a_fixed_distance_along_the_motion():
    k = _kinematics(_straight(vx=30.0, vy=-40.0, y0=200.0))
    now = reporting(IDEAL, k, (parse_effect("contact_trail=0.5"),), _rng)
    assert now.x_mm - k.motion.x_mm == pytest.approx(-0.3, abs=0.002)
    assert now.y_mm - k.motion.y_mm == pytest.approx(0.4, abs=0.002)


def test_smoothing_shrinks_a_circle_as_a_low_pass_does_and_does_not_delay_it():
    t = grid(20.0)
    omega, tau = 8.0, 0.03
    k = _kinematics(motion_of(t, 250 + 50 * np.cos(omega * t), 140 + 50 * np.sin(omega * t), np.ones(len(t), bool)))
    now = reporting(IDEAL, k, (parse_effect(f"smoothing_shrink={tau}"),), _rng)
    middle = slice(2000, -2000)
    radius = np.hypot(now.x_mm - 250, now.y_mm - 140)[middle]
    assert radius == pytest.approx(50 / (1 + (omega * tau) ** 2 / 2), rel=1e-3)
    lag = np.unwrap(np.arctan2(now.y_mm - 140, now.x_mm - 250)) - omega * t
    assert lag[middle] == pytest.approx(0, abs=1e-3)


def test_spatial_warp_bends_across_the_panel_without_tilt_or_mean():
    k = _kinematics(_straight(vx=509.2, vy=0.0, x0=0.0, y0=100.0, duration=1.0))
    now = reporting(IDEAL, k, (parse_effect("spatial_warp=0.6"),), _rng)
    bend = now.y_mm - k.motion.y_mm
    assert bend[[0, 500, 1000]] == pytest.approx([0.6, -0.3, 0.6])
    assert np.polyfit(k.motion.x_mm, bend, 1)[0] == pytest.approx(0, abs=1e-9)
    assert bend.mean() == pytest.approx(0, abs=2e-3)
    assert np.array_equal(now.x_mm, k.motion.x_mm)


def test_scale_error_stretches_about_the_middle():
    _, without, now = _reports("scale_error=0.02")
    assert now.x_mm - 254.6 == pytest.approx(1.02 * (without.x_mm - 254.6))
    assert now.y_mm - 143.2 == pytest.approx(1.02 * (without.y_mm - 143.2))


def test_pitch_ripple_repeats_with_the_pitch():
    k = _kinematics(_straight(vx=50.0, vy=0.0, x0=100.0, y0=100.0, duration=2.0))
    now = reporting(IDEAL, k, (parse_effect("pitch_ripple=0.3,pitch_mm=5"),), _rng)
    ripple = now.y_mm - k.motion.y_mm
    assert ripple.max() == pytest.approx(0.3, rel=1e-3)
    assert ripple[100:] == pytest.approx(ripple[:-100])  # 0.1 s at 50 mm/s is one pitch


# what the stream effects do

EVENTS = TouchEvents(
    np.arange(2000) * 0.00823 + 3.0013, np.arange(2000.0), -np.arange(2000.0), np.zeros(2000, np.int64)
)


def test_sample_hold_ticks_and_repeats_the_last_event():
    held = parse_effect("sample_hold=100").events(EVENTS, _rng())
    assert np.diff(held.t_s) == pytest.approx(0.01, abs=2e-6)
    last = np.searchsorted(EVENTS.t_s, held.t_s, side="right") - 1
    assert np.array_equal(held.x_mm, EVENTS.x_mm[last])
    fast = parse_effect("sample_hold=250").events(EVENTS, _rng())
    assert np.mean(np.diff(fast.x_mm) == 0) == pytest.approx(1 - 0.004 / 0.00823, abs=0.01)


def test_sample_hold_does_not_bridge_a_lifted_stylus():
    gap = EVENTS.take((EVENTS.t_s < 8) | (EVENTS.t_s > 9))
    held = parse_effect("sample_hold=100").events(gap, _rng())
    assert not ((held.t_s > 8.12) & (held.t_s < 8.99)).any()


def test_frames_come_in_groups_stamped_late():
    late = parse_effect("frame_batching=3").events(EVENTS, _rng())
    step = np.diff(late.t_s)
    assert np.mean(step < 1e-4) == pytest.approx(2 / 3, abs=0.01)
    delay = late.t_s - EVENTS.t_s
    assert (delay >= 0).all()
    assert delay.max() == pytest.approx(2 * 0.00823, abs=1e-4)
    assert np.array_equal(late.x_mm, EVENTS.x_mm)


def test_stamps_are_rounded_up_to_the_quantum():
    coarse = parse_effect("timestamp_quantisation=0.004").events(EVENTS, _rng())
    assert coarse.t_s / 0.004 == pytest.approx(np.round(coarse.t_s / 0.004), abs=1e-6)
    delay = coarse.t_s - EVENTS.t_s
    assert delay.min() > -1e-8
    assert delay.max() < 0.004


def test_dropped_frames_are_the_named_share():
    n = len(parse_effect("frame_drop=0.1").events(EVENTS, _rng()).t_s)
    assert n == pytest.approx(1800, abs=4 * np.sqrt(2000 * 0.09))


def test_lost_contact_is_filled_with_straight_lines_or_left():
    bent = replace(EVENTS, y_mm=np.sin(EVENTS.t_s * 5))
    filled = parse_effect("loss_of_contact=30").events(bent, _rng())
    changed = filled.y_mm != bent.y_mm
    assert 0 < changed.sum() < 1000
    assert np.array_equal(filled.t_s, bent.t_s)
    inside = changed[1:-1] & changed[:-2] & changed[2:]
    assert np.diff(filled.y_mm, 2)[inside] == pytest.approx(0, abs=1e-9)
    left = parse_effect("loss_of_contact=30,filled=0").events(bent, _rng())
    assert np.array_equal(left.t_s, bent.t_s[~changed])
    assert np.array_equal(np.flatnonzero(np.diff(left.contact_id)), np.flatnonzero(np.diff(left.t_s) > 0.009))


def test_events_wait_for_the_next_poll():
    frames = replace(EVENTS, t_s=3.0013 + np.arange(2000) * 0.00753)
    polled = parse_effect("poll_grid=0.008,jitter_s=0").events(frames, _rng())
    wait = polled.t_s - frames.t_s
    assert wait.min() > -1e-6
    assert wait.max() < 0.008 + 1e-6
    assert wait.mean() == pytest.approx(0.004, abs=1e-4)
    step = np.diff(polled.t_s)
    assert set(np.round(step / 0.008, 3)) == {0.0, 1.0}  # frames are faster: now and then two come at once
    assert np.mean(step < 1e-3) == pytest.approx(1 - 0.00753 / 0.008, abs=2e-3)
    assert np.array_equal(polled.x_mm, frames.x_mm)
    jittered = parse_effect("poll_grid=0.008,jitter_s=4e-5").events(frames, _rng())
    assert np.std(jittered.t_s - polled.t_s) == pytest.approx(4e-5, rel=0.1)


# what the laser effects do


def test_clock_drift_counts_from_the_start_of_the_session_and_shows_in_clock_pairs():
    plain, _ = _run()
    run, _ = _run((parse_effect("clock_drift=30"),))
    assert run.laser.t_s - plain.laser.t_s == pytest.approx(30e-6 * (plain.laser.t_s - 100), abs=1e-9)
    rate = np.polyfit(run.sync[0].host_min_s, run.sync[0].device_s, 1)[0]
    assert rate - 1 == pytest.approx((30 + RIG.laser_clock_ppm) * 1e-6, abs=8e-6)


def test_clock_offset_is_constant_and_does_not_show_in_clock_pairs():
    plain, _ = _run()
    run, _ = _run((parse_effect("clock_offset=0.005"),))
    assert run.laser.t_s - plain.laser.t_s == pytest.approx(0.005)
    assert np.array_equal(run.sync[0].device_s, plain.sync[0].device_s)


def test_light_returns_late():
    plain, _ = _run()
    run, _ = _run((parse_effect("laser_hysteresis=0.0018"),))
    late = run.laser.t_s - plain.laser.t_s
    assert late[plain.laser.light == 1] == pytest.approx(0.0018)
    assert late[plain.laser.light == 0] == pytest.approx(0.0)


def test_bounces_are_short_and_keep_the_level():
    plain, _ = _run()
    run, _ = _run((parse_effect("laser_bounce=0.5"),))
    extra = len(run.laser.t_s) - len(plain.laser.t_s)
    n = len(plain.laser.t_s)
    assert extra / 2 == pytest.approx(n / 2, abs=4 * np.sqrt(n / 4))
    assert (np.diff(run.laser.light) != 0).all()
    assert (np.diff(run.laser.t_s) < 0.001).sum() >= extra / 2


def _darkness_s(text, x0=250.0):
    k = _kinematics(_straight(vy=100.0, x0=x0, y0=80.0))
    effects = (parse_effect(text),) if text else ()
    dark, light = shadow_edges(replace(IDEAL, beam=replace(IDEAL.beam, slope=0.0)), k, effects).t_s
    return light - dark


def test_beam_width_and_wedge_change_the_shadow():
    assert _darkness_s("") == pytest.approx(0.07, abs=1e-6)
    assert _darkness_s("beam_width=-1") == pytest.approx(0.06, abs=1e-6)
    assert _darkness_s("beam_wedge=2", x0=509.2) == pytest.approx(0.08, abs=1e-6)
    assert _darkness_s("beam_wedge=2", x0=0.0) == pytest.approx(0.06, abs=1e-6)


def _beam_crossed_mm(text, x0):
    """Height at which the beam is crossed by the middle of a stylus that moves straight down at 100 mm/s."""
    k = _kinematics(_straight(vy=100.0, x0=x0, y0=80.0))
    flat = replace(IDEAL, beam=replace(IDEAL.beam, slope=0.0))
    dark, light = shadow_edges(flat, k, (parse_effect(text),) if text else ()).t_s
    return 80.0 + 100.0 * (0.5 * (dark + light) - k.session_s[0])


def test_a_bowed_beam_lies_lower_in_the_middle_and_no_wider():
    middle, quarter, end = (_beam_crossed_mm("beam_bow=0.8", x) - _beam_crossed_mm("", x) for x in (254.6, 127.3, 0.0))
    assert (middle, quarter, end) == (pytest.approx(0.8), pytest.approx(0.6), pytest.approx(0.0, abs=1e-6))
    assert _darkness_s("beam_bow=0.8", x0=254.6) == pytest.approx(0.07, abs=1e-6)


# how effects are written


def test_effects_are_parsed_with_defaults_for_what_is_not_said():
    assert parse_effect("clock_drift=-12.5").value == -12.5
    assert parse_effect("clock_drift").value == 30.0
    assert parse_effect("pitch_ripple=0.2,pitch_mm=7").numbers() == {"amplitude_mm": 0.2, "pitch_mm": 7.0}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("warp_drive=9", r"unknown effect 'warp_drive'; use one of clock_drift, clock_offset"),
        ("clock_drift=fast", r"'fast' is not a number for drift_ppm"),
        ("clock_drift=1e9", r"clock_drift: drift_ppm = 1e\+09 is out of bounds. choose -500 to 500 ppm"),
        ("clock_drift=nan", r"out of bounds"),
        ("frame_batching=2.5", r"frames = 2.5 is no whole number. choose 2"),
        ("pitch_ripple=0.2,colour=1", r"no parameter 'colour'"),
    ],
)
def test_a_wrong_effect_is_refused_in_plain_words(text, words):
    with pytest.raises(DataError, match=words):
        parse_effect(text)


def test_an_effect_given_twice_is_refused():
    with pytest.raises(DataError, match="given twice"):
        parse_effects(["clock_drift=1", "clock_drift=2"])
