"""What a named effect did to the traces is undone there: an electrodes' ripple, and a low-pass that looks back only."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import savgol_filter

from core import sound_sessions
from draglag.errors import EstimateError
from draglag.gap import close_gap
from draglag.gap.correction import corrected
from draglag.gap.fitting.model import LawParameters
from draglag.gap.fitting.state import _not_far
from draglag.gap.replaying.extended import extended_model
from draglag.gap.replaying.realised import effects_of_fit
from draglag.gap.traces.edges import TRACKED_S, _tracked, place
from draglag.gap.traces.law_speed import before_s, delayed_speeds
from draglag.gap.traces.run_data import RunData, as_shown, gather, undone
from draglag.protocol.runs import load_protocol
from draglag.recording import FloatArray, LaserTrace, Run, Session, TouchTrace
from draglag.simulation import simulate_session
from draglag.simulation.effects import EFFECTS
from draglag.simulation.effects.in_fits import UndoneTrace
from draglag.simulation.effects.pitch_ripple.lattice import Lattice, lattice_of
from draglag.simulation.effects.smoothing_shrink.fitted import CausalWindow
from draglag.simulation.effects.smoothing_shrink.fitted import low_passed as filtered
from draglag.simulation.effects.smoothing_shrink.sharpening import Setting, Sharpening
from draglag.simulation.residual import bent

PITCH_MM = 5.3
COLUMNS_MM, ROWS_MM = 0.4, 0.15


@pytest.fixture(scope="module")
def sound() -> Session:
    return sound_sessions.recorded()


def displacement_mm(x_mm: FloatArray, y_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
    turn = 2 * np.pi / PITCH_MM
    return (
        COLUMNS_MM * np.sin(turn * x_mm + 2.0) + ROWS_MM * np.sin(turn * y_mm + 0.3),
        COLUMNS_MM * np.sin(turn * x_mm + 1.0) + ROWS_MM * np.sin(turn * y_mm + 4.0),
    )


def rippled(run: Run) -> Run:
    # The events are a quarter of a millimetre unsure; the ripple is that of where the stylus was.
    x_mm, y_mm = run.touch.x_mm, run.touch.y_mm
    dx, dy = displacement_mm(savgol_filter(x_mm, 13, 5), savgol_filter(y_mm, 13, 5))
    return replace(run, touch=replace(run.touch, x_mm=x_mm + dx, y_mm=y_mm + dy))


@pytest.fixture(scope="module")
def ripple(sound: Session) -> Session:
    return replace(sound, runs=tuple(rippled(run) for run in sound.runs))


def lattice_in(session: Session) -> Lattice | None:
    return lattice_of([(data.t_s, data.xy_mm) for data in gather(session)])


def test_a_sound_session_shows_no_lattice(sound: Session) -> None:
    assert lattice_in(sound) is None


def test_pitch_amplitudes_and_phases_are_those_of_the_ripple(ripple: Session) -> None:
    seen = lattice_in(ripple)
    assert seen is not None
    assert seen.pitch_mm == pytest.approx(PITCH_MM, rel=3e-4)  # 0.02 turns from one side of the panel to the other
    columns = seen.sizes_mm[0] + 1j * seen.sizes_mm[1]
    rows = seen.sizes_mm[2] + 1j * seen.sizes_mm[3]
    assert np.abs(columns - COLUMNS_MM * np.exp(1j * np.array([2.0, 1.0]))).max() < 0.05 * COLUMNS_MM
    assert np.abs(rows - ROWS_MM * np.exp(1j * np.array([0.3, 4.0]))).max() < 0.05 * COLUMNS_MM


def test_undone_traces_are_as_quiet_as_they_were_and_lie_where_they_did(sound: Session, ripple: Session) -> None:
    was, shown = gather(sound), gather(ripple)
    lattice = lattice_in(ripple)
    assert lattice is not None
    flat = undone(shown, [lattice])
    assert [data.run.id for data in flat] == [data.run.id for data in was]
    quick = [k for k, data in enumerate(was) if (data.run.nominal_speed_mm_s or 0) > 150]
    louder = [shown[k].noise_mm / was[k].noise_mm for k in quick]
    left = [flat[k].noise_mm / was[k].noise_mm for k in quick]
    assert np.median(louder) > 1.3
    assert max(left) < 1.1
    off_mm = np.concatenate([flat[k].xy_mm - was[k].xy_mm for k in quick])
    assert np.sqrt(np.mean(off_mm**2)) < 0.15 * np.hypot(COLUMNS_MM, ROWS_MM)
    assert as_shown(flat) == shown


def test_the_workflow_names_the_ripple_and_leaves_what_a_sound_session_has(sound: Session, ripple: Session) -> None:
    floor_mm = sound_sessions.gap_mm(sound_sessions.report_of_recorded())
    report = close_gap(ripple)
    assert report.verdict == "explained"
    (step,) = report.steps
    assert step.effect == "pitch_ripple"
    value, (low, high) = step.parameters["amplitude_mm"]
    assert low < COLUMNS_MM < high
    assert high - low < 0.3 * COLUMNS_MM
    assert step.parameters["pitch_mm"][0] == pytest.approx(PITCH_MM, rel=1e-3)
    assert report.gap_last_mm is not None
    assert report.gap_last_mm < 1.10 * floor_mm < 0.8 * (report.gap_first_mm or 0.0)
    # The model has the ripple whole, not what is left of it in the traces.
    assert report.last is not None
    (effect,) = effects_of_fit(report.last)
    assert effect.value == pytest.approx(value)
    undone, _ = corrected(ripple, extended_model(ripple, report))
    for was, now in zip(gather(sound), gather(undone), strict=True):
        assert now.noise_mm < 1.15 * was.noise_mm  # along the beam as well as across it


TIME_CONSTANT_S = 0.045
LOW_PASS = Sharpening(Setting(TIME_CONSTANT_S))


@pytest.fixture(scope="module")
def low_passed() -> Session:
    """The demo of seed 4 behind a low-pass, whose delay at rest the panel's latency holds already."""
    demo = load_protocol("demo")
    effect = CausalWindow(TIME_CONSTANT_S, (TIME_CONSTANT_S,), (TIME_CONSTANT_S**2,))
    return simulate_session("screen-1", demo, effects=[effect], seed=4)


@pytest.mark.parametrize("step_s", [0.001, 0.005])
def test_a_circle_behind_a_low_pass_is_shrunk_and_late_as_its_transfer_function_says(step_s: float) -> None:
    t = np.arange(0.0, 20.0, step_s)
    omega = 12.0
    shown = filtered(np.cos(omega * t), TIME_CONSTANT_S, step_s) + 1j * filtered(
        np.sin(omega * t), TIME_CONSTANT_S, step_s
    )
    gain = (shown / np.exp(1j * omega * t))[t.size // 10 : -t.size // 10]
    known = np.exp(1j * omega * TIME_CONSTANT_S) / (1 + 1j * omega * TIME_CONSTANT_S)
    assert np.abs(gain - known).max() < (omega * step_s) ** 2 / 4  # a chord and a sampled kernel, an eighth each


def test_a_low_pass_is_named_and_the_gap_is_that_of_the_session_without_it(low_passed: Session) -> None:
    floor_mm = sound_sessions.gap_mm(sound_sessions.report_of_demo(seed=4))
    report = close_gap(low_passed)
    assert report.verdict == "explained"
    (step,) = report.steps
    assert step.effect == "smoothing_shrink"
    assert step.parameters["time_constant_s"][0] == pytest.approx(TIME_CONSTANT_S, rel=0.03)
    assert report.gap_last_mm is not None
    assert report.gap_first_mm is not None
    assert report.gap_last_mm < 1.15 * floor_mm < 0.7 * report.gap_first_mm
    # Tremor and quick circles are undone as well, which the mean effect of a low-pass on the edges does not do.
    assert report.last is not None
    (term,) = report.last.terms
    assert term.theta == (pytest.approx(TIME_CONSTANT_S, rel=0.03),)
    (again,) = effects_of_fit(report.last)
    assert again.value == pytest.approx(TIME_CONSTANT_S, rel=0.03)


def test_events_of_a_sharpened_trace_share_noise_as_they_are_said_to(low_passed: Session) -> None:
    data = gather(low_passed)[5]
    (sharp,) = undone((data,), [LOW_PASS])
    rng = np.random.default_rng(3)
    noise_mm = rng.normal(0, 0.1, data.xy_mm.shape)
    (louder,) = undone((replace(data, xy_mm=data.xy_mm + noise_mm),), [LOW_PASS])
    assert sharp.spread is not None
    # By how much a window flattens a circle follows from its turn, which noise of 0.1 mm moves by less than 1 %: of the
    # gain, here 0.99, a ten-thousandth.
    assert louder.xy_mm - sharp.xy_mm == pytest.approx(sharp.spread @ noise_mm, abs=1e-4)
    assert sharp.t_s[0] - data.t_s[0] >= TIME_CONSTANT_S
    assert as_shown((sharp,)) == (data,)


def test_a_trace_too_short_to_be_freed_is_refused(low_passed: Session) -> None:
    data = gather(low_passed)[5]
    short = replace(data, t_s=data.t_s[:4], xy_mm=data.xy_mm[:4])
    with pytest.raises(EstimateError, match="cannot be freed"):
        undone((short,), [LOW_PASS])


@pytest.mark.parametrize("even", [False, True], ids=["causal", "symmetric"])
def test_a_quick_circle_is_freed_of_a_low_pass_whole(even: bool) -> None:
    # Over its windows a circle turns by 1.8 rad to either side: a local fit shows 98.8 % of its speed and 83 % of its
    # acceleration. The scale of the path has to come back to a fifth of a percent, here 0.1 mm.
    t = np.arange(0.0, 6.0, 0.005)
    omega, radius_mm, half_s = 12.0, 50.0, 0.15
    gain = 1 / (1 + 0.5 * (omega * TIME_CONSTANT_S) ** 2) if even else 1 / (1 + 1j * omega * TIME_CONSTANT_S)
    ahead_s = 0.0 if even else TIME_CONSTANT_S
    turned = gain * radius_mm * np.exp(1j * omega * t)
    shown = SimpleNamespace(speed_half_s=np.array([half_s]))
    trace = UndoneTrace(t, np.column_stack([turned.real, turned.imag]), 0.0)
    freed = Sharpening(Setting(TIME_CONSTANT_S, even)).undo(trace, shown, 0.0)  # type: ignore[arg-type]
    own_s = freed.t_s - ahead_s
    whole = (own_s > half_s) & (own_s < t[-1] - half_s)  # windows with events on both sides
    off_mm = freed.xy_mm @ [1, 1j] - radius_mm * np.exp(1j * omega * own_s)
    assert np.abs(off_mm[whole]).max() < 0.002 * radius_mm


def test_a_shrunk_circle_shows_the_law_too_low_a_speed() -> None:
    # A circle of 30 mm at 8 rad/s, shrunk by a low-pass of 30 ms: the panel shows its speed lower by 2.8 %.
    omega, radius_mm, tau_s, slope = 8.0, 30.0, 0.03, -1e-4
    n = np.ones(3)
    view = SimpleNamespace(
        speed=omega * radius_mm * n,
        turn_rad_s=omega * n,
        law_slope=slope * n,
        a_across=-(omega**2) * radius_mm * np.array([-1, 0, 1]),
    )
    made = bent(view, 0.5)  # type: ignore[arg-type]
    shrunk = 0.5 * (omega * tau_s) ** 2
    assert made.latency is not None
    assert made.offset is not None
    assert tau_s**2 * made.latency[:, 0] == pytest.approx(slope * shrunk * omega * radius_mm)
    assert tau_s**2 * made.offset[:, 0] == pytest.approx(shrunk * radius_mm * np.array([1, 0, -1]))


def test_a_low_pass_of_no_time_leaves_a_path_as_it_is() -> None:
    path_mm = np.linspace(0.0, 5.0, 50)
    assert np.array_equal(filtered(path_mm, 0.0, 0.001), path_mm)


def test_a_trackers_window_flattens_a_sine_of_the_speed_by_its_transfer_function() -> None:
    """Of a Gaussian window, exp(−ω²σ²/2)."""
    shape_hz, n = 4.0, 2000
    t_s = np.linspace(0.0, 8.0, n)
    speed = 300.0 + 40.0 * np.sin(2 * np.pi * shape_hz * t_s)
    traces = SimpleNamespace(
        t_s=t_s, begin=np.array([0, n]), run=np.zeros(5, np.int64), keeps_moving=np.array([True] * 4 + [False])
    )
    at_s = np.array([1.0, 3.03, 5.11, 6.2, 4.4])
    kept = np.exp(-0.5 * (2 * np.pi * shape_hz * TRACKED_S) ** 2)
    expected = (kept - 1) * 40.0 * np.sin(2 * np.pi * shape_hz * at_s)
    expected[-1] = 0.0  # the hand rests
    assert _tracked(traces, (t_s, speed), at_s) == pytest.approx(expected, abs=0.05)  # of interpolation


def test_a_trackers_window_reaches_into_no_other_run() -> None:
    t_s, speed = np.array([0.0, 8.0, 18.0, 26.0]), np.array([100.0, 100.0, 900.0, 900.0])
    traces = SimpleNamespace(t_s=t_s, begin=np.array([0, 2, 4]), run=np.array([0, 1]), keeps_moving=np.ones(2, bool))
    assert _tracked(traces, (t_s, speed), np.array([7.99, 18.01])) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("delay_s", [0.0, 0.05, -0.03], ids=["of now", "of before", "of later"])
def test_the_speed_that_a_law_is_asked_at_is_followed_behind_what_the_trace_shows(delay_s: float) -> None:
    # A drag of 80 mm/s, uneven by 4 mm/s at 2 Hz, on a screen whose latency falls by 1 ms a mm/s: what is shown leads
    # by an eighth of a turn and is 1.4 times as uneven.
    t = np.arange(0.0, 20.0, 0.001)
    speed = 80 + 4 * np.sin(2 * np.pi * 2 * t)
    place_mm = np.cumsum(speed) * 0.001

    def law(speed_mm_s: FloatArray) -> FloatArray:
        return 0.15 - 0.001 * speed_mm_s

    host_s = np.arange(0.2, 19.8, 0.008)
    asked = 80 + 4 * np.sin(2 * np.pi * 2 * (t - delay_s))
    shown_mm = np.interp(host_s, t + law(asked), place_mm)
    touch = TouchTrace(host_s, shown_mm, np.zeros(host_s.size))
    run = Run("a", "circle", 0.0, 20.0, touch, LaserTrace(np.zeros(0), np.zeros(0, np.int64)))
    estimate = SimpleNamespace(speed_mm_s=80.0)
    xy_mm = np.column_stack([touch.x_mm, touch.y_mm])
    none = np.zeros(0)
    wide_s = np.full(1, 0.05)
    data = RunData(run, host_s, xy_mm, none, none.astype(bool), 0.05, wide_s, 0.1, estimate, none, host_s)  # type: ignore[arg-type]
    edges_s = np.arange(2.0, 18.0, 0.037)
    true = np.interp(edges_s, t, asked)
    at_s = edges_s + law(true)
    seen = np.interp(at_s, *data.quick)
    (speeds,) = delayed_speeds([data], law, (0.0, delay_s))
    followed = np.interp(at_s, *speeds)
    assert np.std(seen - true) > 1.5
    assert np.std(followed - true) < 0.25
    assert np.abs(np.mean(followed - true)) < 0.1


@pytest.mark.parametrize("asked", [(0.0, 0.0), (0.0, 0.06), (1.0, -0.08)], ids=["of now", "of before", "of the report"])
def test_a_chirps_speed_is_followed_where_the_laws_slope_changes_with_it(asked: tuple[float, float]) -> None:
    # 30 to 160 mm/s in 30 s, uneven by a tenth at 1 Hz, on a steep law: what is shown leads by 60 ms where it is slow.
    t = np.arange(0.0, 40.0, 0.001)
    speed = (30 + 130 * t / 40) * (1 + 0.1 * np.sin(2 * np.pi * t))
    place_mm = np.cumsum(speed) * 0.001

    def law(speed_mm_s: FloatArray) -> FloatArray:
        return 0.19 * np.exp(-0.022 * np.asarray(speed_mm_s)) + 0.05 * np.exp(-0.004 * np.asarray(speed_mm_s)) + 0.03

    delayed_mm_s = np.interp(t - before_s(asked, law(speed)), t, speed)
    host_s = np.arange(1.0, 39.0, 0.008)
    noise_mm = np.random.default_rng(4).normal(0, 0.1, host_s.size)
    shown_mm = np.interp(host_s, t + law(delayed_mm_s), place_mm) + noise_mm
    touch = TouchTrace(host_s, shown_mm, np.zeros(host_s.size))
    run = Run("a", "chirp", 0.0, 40.0, touch, LaserTrace(np.zeros(0), np.zeros(0, np.int64)))
    none = np.zeros(0)
    xy_mm = np.column_stack([touch.x_mm, touch.y_mm])
    data = RunData(run, host_s, xy_mm, none, none.astype(bool), 0.1, np.full(1, 0.13), 0.1, None, none, host_s)
    edges_s = np.arange(3.0, 36.0, 0.037)
    true = np.interp(edges_s, t, delayed_mm_s)
    at_s = edges_s + law(true)
    (speeds,) = delayed_speeds([data], law, asked)
    off_mm_s = np.interp(at_s, *speeds) - true
    assert np.std(np.interp(at_s, *data.quick) - true) > 2.5
    assert np.std(off_mm_s) < 1.0  # of which noise through a window of 0.26 s is 0.35
    assert np.abs(np.mean(off_mm_s)) < 0.3


@pytest.mark.parametrize("delay_s", [0.1, -0.1])
def test_an_edge_whose_laws_speed_no_trace_shows_is_left_out(sound: Session, delay_s: float) -> None:
    runs = gather(sound)
    law = LawParameters(0.05, 4e-3, 0.05, 2e-2, 0.03)
    now, then = place(runs, law), place(runs, law, delay=(0.0, delay_s))
    moment_s = then.t_s + then.latency_s - delay_s
    ends_s = np.array([(data.t_s[0], data.t_s[-1]) for data in runs])[then.run]
    outside = (moment_s < ends_s[:, 0]) | (moment_s > ends_s[:, 1])
    assert np.count_nonzero(now.ok & outside) > 0
    assert not then.ok[outside].any()
    assert np.mean(then.ok[now.ok & ~outside]) > 0.99


def test_an_edge_of_a_stylus_that_stands_nearly_still_is_no_level_of_its_own() -> None:
    rng = np.random.default_rng(2)
    v = np.append(rng.choice([-1.0, 1.0], 25) * rng.uniform(180, 260, 25), -3.0)
    residual_mm = np.append(rng.normal(0, 0.15, 25), -8.4)
    placed = SimpleNamespace(
        run=np.zeros(26, np.int64), v_mm_s=np.column_stack([np.zeros(26), v]), falling=rng.random(26) < 0.5
    )
    keep = _not_far(residual_mm, np.full(26, 0.15), placed, np.ones(26, bool), loose=False)  # type: ignore[arg-type]
    assert keep[:25].all()
    assert not keep[25]


def test_a_ripple_that_may_not_be_named_is_reported_although_edges_hardly_scatter(sound: Session) -> None:
    def weakly(run: Run) -> Run:
        touch, whole = run.touch, rippled(run).touch
        x_mm, y_mm = touch.x_mm + 0.5 * (whole.x_mm - touch.x_mm), touch.y_mm + 0.5 * (whole.y_mm - touch.y_mm)
        return replace(run, touch=replace(touch, x_mm=x_mm, y_mm=y_mm))

    others = [effect for effect in EFFECTS if effect != "pitch_ripple"]
    report = close_gap(replace(sound, runs=tuple(map(weakly, sound.runs))), candidates=others)
    assert (report.verdict, report.unexplained_by, report.steps) == ("unexplained", "x", ())
    assert close_gap(sound, candidates=others).verdict == "no_gap"
