"""The realistic world's laws, hand, beam, host and draws."""

import gzip
from dataclasses import replace

import numpy as np
import pytest

from blind.displacement import displaced_by, displacements
from blind.physics.law import FORMS, VELOCITY, draw_law, draw_transport
from blind.physics.real.beam import Sensor, crossings
from blind.physics.real.hand import drag
from blind.physics.real.moves import move
from blind.physics.real.rig import draw_real_rig, own_sizes
from blind.physics.rig import Profile
from blind.physics.session import make_session
from blind.realistic import quick_real_tasks, real_tasks, refitted
from blind.visibility import residuals

SHORT = Profile(
    world="realistic", law_form="logistic", protocol="speeds", n_speeds=5, run_s=25.0, varied_runs=False, taps="both"
)
CLEAN = replace(SHORT, noise=0.0)
SEED = 21


@pytest.fixture(scope="module")
def clean_twin():
    return make_session(None, SEED, {}, CLEAN)


@pytest.mark.parametrize("form", FORMS)
def test_laws_fall_to_their_asymptote(form):
    law = draw_law(np.random.default_rng(3), form)
    v = np.array([20.0, 45.0, 100.0, 300.0, 1000.0, 1e7])
    late = law(v)
    assert np.all(np.diff(late) <= 1e-12)
    assert late[-1] == pytest.approx(law.asymptote_s, abs=1e-3)
    assert 0.02 <= late.min() <= late[1] < 0.35
    assert (late[0] - late[-1] < 1e-9) == (form == "constant")


def test_laws_at_known_points():
    rng = np.random.default_rng(4)
    adaptive, logistic, power = (draw_law(rng, form) for form in ("adaptive", "logistic", "power"))
    p = adaptive.parameters
    assert adaptive(np.array([100.0]))[0] - p["floor"] == pytest.approx(1 / (2 * np.pi * (p["f0"] + 100 * p["beta"])))
    p = logistic.parameters
    assert logistic(np.array([p["middle"]]))[0] == pytest.approx(0.5 * (p["floor"] + p["slow"]))
    p = power.parameters
    assert power(np.array([45.0]))[0] == pytest.approx(p["floor"] + p["scale"])
    slow, fast = draw_transport(rng)(np.array([45.0, 900.0]))
    assert 0.02 <= slow == fast <= 0.035


def test_hand_draws_imperfect_ellipses_by_the_two_thirds_power_law():
    for seed in range(3):
        motion = drag(np.random.default_rng(seed), 300.0, 40.0, 20.0, (150.0, 100.0), 0.0)
        k = slice(4000, -4000)
        x, y = motion.x_mm[k] - 150, motion.y_mm[k] - 100
        minor, major = np.sqrt(np.linalg.eigvalsh(np.cov(x, y)))
        assert 0.76 < minor / major <= 1.0
        assert motion.speed_mm_s[k].mean() == pytest.approx(300.0, rel=0.06)
        # v ~ curvature^(-1/3): fastest where an ellipse is flattest, at the ends of its minor axis
        if minor / major < 0.93:
            along = np.linalg.eigh(np.cov(x, y))[1][:, 1]
            far = np.abs(x * along[0] + y * along[1]) / major
            assert motion.speed_mm_s[k][far < 0.4].mean() > motion.speed_mm_s[k][far > 1.2].mean()


def test_hand_pauses_in_slow_runs_only():
    def stopped(speed):
        return sum(
            np.any(drag(np.random.default_rng(seed), speed, 30.0, 25.0, (0, 0), 50.0).speed_mm_s < 0.15 * speed)
            for seed in range(8)
        )

    assert stopped(60.0) >= 3
    assert stopped(500.0) == 0


def test_comparators_hysteresis_makes_both_edges_late():
    t = np.arange(0, 4, 1 / 4000)
    off = 100.0 * (t - 2)
    sensor = Sensor(0.3, 0.35, 0.02)
    stamps, levels, ideal = crossings(np.random.default_rng(1), sensor, t, off, 3.5, (0.0, 4.0), missed_share=0.0)
    assert levels.tolist() == [0, 1]
    late = stamps - ideal - sensor.response_s
    slope = np.exp(-0.5 * (sensor.widens_mm / 2 / 0.3) ** 2) / (0.3 * np.sqrt(2 * np.pi))
    np.testing.assert_allclose(late, 0.02 / slope / 100.0, rtol=0.05)
    assert np.diff(ideal)[0] * 100 == pytest.approx(7.0 + sensor.widens_mm, abs=1e-3)


def test_the_rigs_own_width_is_that_of_its_shadow():
    """Of a sound rig, from what light its sensor gets as a disc of its diameter passes slowly."""
    rig = make_session(None, SEED, {}, CLEAN).rig
    t = np.arange(0, 4, 1 / 4000)
    exact = replace(rig.sensor, hysteresis=0.0)
    stamps, _, _ = crossings(np.random.default_rng(1), exact, t, 10.0 * (t - 2), 0.5 * rig.disc_mm, (0, 4), 0.0)
    shadow_mm = 10.0 * np.diff(stamps)[0]
    assert own_sizes(rig)["beam_width"] == pytest.approx(shadow_mm - rig.diameter_mm, abs=1e-3)
    assert own_sizes(replace(rig, sensor=None)) == {}


def test_passes_are_missed_as_often_as_said():
    t = np.arange(0, 200, 1 / 1000)
    off = 20 * np.sin(2 * np.pi * t)
    span = (0.0, 200.0)
    stamps, levels, _ = crossings(np.random.default_rng(1), Sensor(0.3, 0.35, 0.01), t, off, 3.5, span)
    assert 780 < len(stamps) < 800
    assert np.all(np.diff(levels) != 0)


def test_true_latency_aligns_the_edges_of_a_sound_session(clean_twin):
    left = np.concatenate([r for r, _ in residuals(clean_twin, clean_twin).values()])
    assert len(left) > 250
    # the beam's bow (0.03 mm), response (55 us) and hysteresis, the calibration of the width (0.02 mm)
    assert np.sqrt(np.mean(left**2)) < 0.08


def test_rate_jitter_steps_and_polls_are_in_the_files(tmp_path):
    truth = make_session(tmp_path / "a", SEED, {"poll_grid": 0.008}, SHORT)
    with gzip.open(tmp_path / "a" / "run-01.touch.csv.gz", "rt") as file:
        t, x, _ = np.loadtxt(file, delimiter=",", skiprows=1).T
    past = (t / 0.008 - truth.variants["poll_grid"]["phase"]) % 1 * 0.008
    assert np.median(past) < 1e-4
    assert past.max() < 3e-4
    assert np.all(np.diff(t) > 0.007)
    step = truth.rig.step_mm
    assert np.abs(x / step - np.round(x / step)).max() * step < 2e-4
    assert 0.01 <= step <= 0.1


def test_each_new_effect_moves_edges_as_it_should(clean_twin):
    def moved(name, size):
        return displaced_by(make_session(None, SEED, {name: size}, CLEAN), clean_twin)

    assert moved("warm_up", 0.012).gap_mm > 0.1
    bow = moved("beam_bow", 0.8)
    assert 0.1 < bow.gap_mm < bow.rms_mm < 0.8
    polled = moved("poll_grid", 0.008)
    vy = np.concatenate([d["vy_mm_s"] for d in clean_twin.details.values()])
    # stamps wait for half a period on average, which a constant of the law takes up, and for a third of it squared
    assert polled.rms_mm == pytest.approx(np.sqrt(np.mean(vy**2)) * 0.008 / np.sqrt(3), rel=0.25)
    assert polled.gap_mm < 0.7 * polled.rms_mm


def test_warm_up_saturates():
    late = {}
    for name, effects in (("cold", {}), ("warm", {"warm_up": 0.02})):
        truth = make_session(None, SEED, effects, CLEAN)
        late[name] = {run.id: truth.details[run.id]["latency_s"].mean() for run in truth.rig.plan}
        tau = truth.variants.get("warm_up", {}).get("time_constant_s")
    for run in truth.rig.plan:
        middle = run.start_s + run.duration_s / 2
        expected = 0.02 * np.exp(-middle / tau)
        assert late["warm"][run.id] - late["cold"][run.id] == pytest.approx(expected, abs=3e-4)


def test_displacement_of_filters_is_known_and_negligible_ones_are():
    profile = replace(CLEAN, noise=1.0, scan_hz=500.0)
    alone, together = displacements(SEED, {"deadband": 0.01}, profile)
    assert together == alone["deadband"]
    assert together.rms_mm < 0.02
    assert not together.matters
    # 15 ms ahead at these speeds: taps show that curve and taps part
    alone, together = displacements(SEED, {"prediction": 0.015}, profile)
    assert together.rms_mm > 1.0
    assert together.taps_show
    assert together.matters
    assert displacements(SEED, {}, profile) == ({}, None)


def test_true_latency_of_a_filter_is_what_it_adds(tmp_path):
    """A low-pass of 30 ms on a panel that needs 25 to 35 ms for itself."""
    profile = replace(SHORT, law_form="transport", scan_hz=500.0, n_speeds=3)
    truth = make_session(tmp_path, SEED, {"first_order_iir": 0.03}, profile)
    level_ms = 1e3 * truth.rig.law.asymptote_s
    for run in truth.rig.plan:
        if run.nominal_speed_mm_s < 300:
            assert truth.true_latency_ms[run.id] == pytest.approx(level_ms + 30.0, abs=1.5)


def test_draw_is_reproducible_and_covers_every_row():
    many = real_tasks(1, seed=5)
    assert many == real_tasks(1, seed=5)
    assert many != real_tasks(1, seed=6)
    assert {task.law_form for task in many if task.kind == "none"} == {*FORMS, VELOCITY}
    assert all(task.world == "realistic" for task in many)
    assert all(task.law_form != "constant" for task in many if task.row in ("lagging_law", "low_speed_plateau"))
    new = {"speed_adaptive_filter", "prediction", "deadband", "warm_up", "beam_bow", "poll_grid"}
    for kind in ("single", "below"):
        assert new <= {task.row for task in many if task.kind == kind}
    assert new <= {task.row for task in quick_real_tasks(1)}
    assert len({task.seed for task in many}) == len(many)
    assert {task.row for task in real_tasks(1, 5, ("sound",))} == {f"sound_{form}" for form in (*FORMS, VELOCITY)}


def test_the_size_of_a_mean_velocity_is_less_where_the_path_turns():
    """By exp(−½ ω² σ²) on a circle of the rate ω, with the standard deviation σ of the window."""
    rig = draw_real_rig(SEED, Profile(world="realistic", law_form=VELOCITY))
    assert 0.01 < rig.velocity_window_s < 0.02
    fastest = max(
        (run for run in rig.plan if run.protocol == "circle"), key=lambda run: run.nominal_speed_mm_s / run.radius_mm
    )
    moment = move(replace(rig, speed_window_s=1e-3, velocity_window_s=0.0), fastest, SEED)
    mean = move(rig, fastest, SEED)
    turning_rad_s = np.median(np.gradient(np.unwrap(np.arctan2(moment.vy_mm_s, moment.vx_mm_s)), moment.t_s))
    lost = -np.log(np.median(mean.speed_mm_s) / np.median(moment.speed_mm_s))
    assert lost == pytest.approx(0.5 * (turning_rad_s * rig.velocity_window_s) ** 2, rel=0.15)


def test_same_seed_same_bytes(tmp_path):
    for name in ("a", "b"):
        make_session(tmp_path / name, SEED, {"speed_adaptive_filter": 1.0}, replace(SHORT, n_speeds=2, scan_hz=500.0))
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes()
    assert "speed_adaptive" not in (tmp_path / "a" / "session.json").read_text()


def test_sizes_are_adjusted_until_they_matter_or_do_not():
    tasks = {(task.kind, task.row): task for task in real_tasks(1, seed=5)}
    deadband, below, euro = (
        tasks[key] for key in (("single", "deadband"), ("below", "deadband"), ("single", "speed_adaptive_filter"))
    )
    assert refitted(deadband, gap_mm=0.2) is None
    assert deadband.effects["deadband"] < refitted(deadband, gap_mm=0.09)["deadband"] <= 0.8
    assert refitted(below, gap_mm=0.1)["deadband"] < below.effects["deadband"]
    assert refitted(below, gap_mm=0.01) is None
    # a lower cut-off is a stronger filter
    assert refitted(euro, gap_mm=0.09)["speed_adaptive_filter"] <= euro.effects["speed_adaptive_filter"]
    assert refitted(tasks["single", "scan_skew"], gap_mm=0.01) is None
