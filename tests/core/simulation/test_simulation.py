"""The simulated rig obeys its latency law exactly when it is ideal, and is as noisy as it says when it is not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from draglag.protocol.runs import expand, load_protocol, load_screen_file
from draglag.protocol.targets import Circle
from draglag.recording import Beam
from draglag.simulation import (
    PERFECT,
    Human,
    LatencyLaw,
    follow,
    rig_for_screen,
    simulate_run_with_truth,
    simulate_session,
    simulate_session_with_truth,
    simulate_taps,
)
from draglag.simulation.digitiser import arrival
from draglag.simulation.sensor import beam_distance_mm

RIG = rig_for_screen("screen-1")
PLANNED = expand(load_protocol("demo"), RIG.screen, beam=RIG.beam)


def _record(rig, planned, human=None, seed=1, **options):
    rng = np.random.default_rng(seed)
    motion = follow(planned.target, human or Human(), rng)
    run, truth = simulate_run_with_truth(
        rig, motion, run_id=planned.id, planned=planned, start_s=50.0, rng=rng, **options
    )
    return run, truth, motion


def test_law_gives_table_2_latencies():
    law = RIG.law
    assert law.latency_s(0.0) == pytest.approx((90.53 + 182.9 + 28.49) / 1000)
    assert law.latency_s([44.0, 1e6]) == pytest.approx(
        [(90.53 * np.exp(-0.176) + 182.9 * np.exp(-1.276) + 28.49) / 1000, 0.02849]
    )


@pytest.mark.parametrize("planned", [p for p in PLANNED if p.kind in ("circle", "chirp")], ids=lambda p: p.id)
def test_an_ideal_touch_event_says_where_the_stylus_was_one_latency_ago(planned):
    """At t_edge + L(v(t_edge)) the trace puts the stylus half a diameter from the beam."""
    run, truth, _ = _record(RIG.ideal(), planned, Human(tremor_mm=0.0))
    assert len(truth.edge_s) > 15
    assert truth.latency_s == pytest.approx(RIG.law.latency_s(truth.speed_mm_s), abs=2e-5)
    at = truth.edge_s + truth.latency_s
    inside = (at > run.touch.t_s[3]) & (at < run.touch.t_s[-4])
    x, y = (CubicSpline(run.touch.t_s, p)(at[inside]) for p in (run.touch.x_mm, run.touch.y_mm))
    miss = np.abs(beam_distance_mm(RIG.beam, x, y)) - 3.5
    # 1 kHz grid and 120 Hz splines: micrometres; slow parts of the motion may be overtaken by fresher news
    assert np.median(np.abs(miss)) < 0.002
    assert np.mean(np.abs(miss) < 0.05) > 0.9


def test_a_perfect_hand_is_the_target_and_edges_come_at_the_analytic_times():
    circle = Circle(250.0, 143.2, 50.0, 200.0, 40.0, 0.0)
    rig = replace(RIG.ideal(), beam=Beam(0.0, 143.2))
    planned = replace(PLANNED[0], target=circle)
    run, truth, motion = _record(rig, planned, PERFECT)
    assert motion.x_mm == pytest.approx(circle.position_mm(motion.t_s)[0])
    assert motion.speed_mm_s[1:-1] == pytest.approx(200.0, rel=1e-4)
    omega = 200 / 50
    half = np.arcsin(3.5 / 50)
    first = np.array([np.pi / 2 - half, np.pi / 2 + half, 3 * np.pi / 2 - half, 3 * np.pi / 2 + half]) / omega
    assert run.laser.t_s[:4] - 50.0 == pytest.approx(first, abs=2e-6)
    assert run.laser.light[:4].tolist() == [0, 1, 0, 1]
    assert truth.mean_latency_s == pytest.approx(float(RIG.law.latency_s(200.0)), abs=1e-6)


def test_a_person_is_a_few_millimetres_off_and_late():
    for planned in PLANNED:
        motion = follow(planned.target, Human(), np.random.default_rng(3))
        x, y = planned.target.position_mm(np.clip(motion.t_s - Human().lag_s, 0, None))
        error = np.hypot(motion.x_mm - x, motion.y_mm - y)
        assert 0.3 < np.median(error) < 20  # slow circles: wander; fast ones: some 20 ms of timing
        start = motion.t_s[np.argmax(motion.in_contact)]
        assert 0.2 <= start <= 0.5


def test_noise_is_as_large_as_the_rig_says():
    quiet = replace(RIG.ideal(), noise_mm=0.2, noise_slow_share=0.0)
    clean, _, _ = _record(RIG.ideal(), PLANNED[0])
    noisy, _, _ = _record(quiet, PLANNED[0])
    n = len(clean.touch.t_s)
    error = noisy.touch.y_mm - clean.touch.y_mm
    assert error.std() == pytest.approx(0.2, rel=4 / np.sqrt(2 * n))
    assert abs(np.corrcoef(error[1:], error[:-1])[0, 1]) < 4 / np.sqrt(n)
    slow, _, _ = _record(replace(quiet, noise_slow_share=0.5), PLANNED[0])
    error = slow.touch.y_mm - clean.touch.y_mm
    assert error.std() == pytest.approx(0.2, rel=0.15)
    expected = 0.5 * np.exp(-1 / (120 * quiet.noise_slow_s))
    assert np.corrcoef(error[1:], error[:-1])[0, 1] == pytest.approx(expected, abs=0.08)


def test_touch_comes_at_the_scan_rate_and_contact_loss_starts_a_new_contact():
    run, _, _ = _record(replace(RIG, contact_loss_per_s=0.2), PLANNED[0])
    step = np.diff(run.touch.t_s)
    assert np.median(step) == pytest.approx(1 / 120, rel=0.02)
    lost = np.flatnonzero(step > 0.02)
    assert len(lost) >= 2
    assert (np.diff(run.touch.contact_id)[lost] > 0).all()
    assert (np.diff(run.touch.contact_id)[step < 0.012] == 0).all()


def test_sensor_delay_moves_every_edge_by_the_same_time():
    ideal, _, _ = _record(RIG.ideal(), PLANNED[0])
    late, _, _ = _record(replace(RIG.ideal(), sensor_response_s=55e-6), PLANNED[0])
    assert late.laser.t_s - ideal.laser.t_s == pytest.approx(55e-6, abs=1e-9)


def test_fresher_news_is_never_overtaken_by_older():
    t = np.arange(0, 1, 1e-3)
    latency = np.where(t < 0.5, 0.3, 0.03)
    tau = arrival(t, latency)
    assert (np.diff(tau) > 0).all()
    assert tau[t >= 0.5] == pytest.approx(t[t >= 0.5] + 0.03)  # fast news keeps its own latency
    assert (tau <= t + latency + 1e-8).all()


def test_a_stamp_of_the_laser_clock_lies_between_its_bounds():
    run, _, _ = _record(RIG, PLANNED[0])
    sync = run.sync[0]
    host = (run.laser.device_t_s - RIG.laser_clock_offset_s) / (1 + RIG.laser_clock_ppm * 1e-6)
    assert host == pytest.approx(run.laser.t_s, abs=1e-9)
    true = (sync.device_s - RIG.laser_clock_offset_s) / (1 + RIG.laser_clock_ppm * 1e-6)
    assert (sync.host_min_s < true).all()
    assert (true < sync.host_max_s).all()


def test_taps_have_the_medians_of_the_preset():
    taps = simulate_taps(RIG, 2000, start_s=10.0, rng=np.random.default_rng(1))
    late = taps.registered_s - taps.physical_s
    sd_of_median = 1.25 * RIG.tap_spread_s / np.sqrt(2000)
    assert np.median(late[taps.down == 1]) == pytest.approx(RIG.tap_touch_s, abs=4 * sd_of_median)
    assert np.median(late[taps.down == 0]) == pytest.approx(0.02875, abs=4 * sd_of_median)
    assert (np.diff(taps.physical_s) > 0).all()
    assert taps.down[:4].tolist() == [1, 0, 1, 0]


def test_a_session_is_whole_and_in_order():
    session, truth = simulate_session_with_truth("screen-2", "demo", seed=4, session_start_s=100.0)
    assert [run.id for run in session.runs] == list(truth.runs)
    assert {run.protocol for run in session.runs} == {"circle", "chirp", "multisine", "step"}
    assert len(session.taps.down) == 200
    assert session.clocks[0].stream == "laser"
    ends = [run.start_s + run.duration_s for run in session.runs]
    assert all(later.start_s > end for later, end in zip(session.runs[1:], ends, strict=False))
    for run, end in zip(session.runs, ends, strict=True):
        assert run.start_s >= 100
        for t in (run.touch.t_s, run.laser.t_s):
            assert (np.diff(t) > 0).all()
            assert run.start_s <= t[0] <= t[-1] <= end + 1e-3
        assert (np.diff(run.laser.light) != 0).all()
        assert truth.runs[run.id].mean_latency_s > 0.028
    assert session.screen.name == "screen-2"
    assert session.protocol_toml == load_protocol("demo").source


def test_the_same_seed_gives_the_same_session_and_another_does_not():
    first, again = (simulate_session("screen-1", "demo", seed=7) for _ in range(2))
    other = simulate_session("screen-1", "demo", seed=8)
    for a, b, c in zip(first.runs, again.runs, other.runs, strict=True):
        assert np.array_equal(a.touch.x_mm, b.touch.x_mm)
        assert np.array_equal(a.laser.t_s, b.laser.t_s)
        assert not np.array_equal(a.touch.t_s, c.touch.t_s)
    assert np.array_equal(first.taps.registered_s, again.taps.registered_s)


def test_a_rig_of_ones_own_can_be_measured():
    rig = replace(RIG, law=LatencyLaw(0.0, 0.0, 0.0, 0.0, 50.0), run_latency_sd_s=0.0)
    _, truth = simulate_session_with_truth(rig, "demo", seed=1)
    assert [t.mean_latency_s for t in truth.runs.values()] == pytest.approx([0.05] * len(truth.runs))


@pytest.mark.parametrize("name", ["screen-1", "screen-2", "screen-2-uncorrected"])
def test_the_preset_rig_has_the_screen_files_numbers(name):
    rig, preset = rig_for_screen(name), load_screen_file(name)
    assert rig.law.a4_ms == preset.law.a4_ms
    assert rig.touch_rate_hz == preset.digitiser.touch_rate_hz
    assert rig.beam.slope * rig.screen.width_mm / 2 + rig.beam.intercept_mm == pytest.approx(rig.screen.height_mm / 2)
