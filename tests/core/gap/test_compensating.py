"""Compensated events against the movement of the stylus that the simulation knows."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

import draglag as dl
from draglag.curve import CurveFit, CurvePoints, fit_form
from draglag.errors import DataError
from draglag.gap.compensating import CompensatedEvents, compensate_events
from draglag.gap.correction import corrected_touch
from draglag.model.file import OF_SPEED, LatencyModel, ModelEffect, Provenance, model_of
from draglag.path.events import events_of_several
from draglag.protocol.runs import Protocol, RunPlan, expand
from draglag.recording import TouchTrace
from draglag.simulation.chain import simulate_run
from draglag.simulation.effects import EFFECTS, Effect
from draglag.simulation.hand import Human, follow
from draglag.simulation.kinematics import Motion
from draglag.simulation.rig import rig_for_screen

RIG = rig_for_screen("screen-1")
START_S = 2.0
FAST = RunPlan(kind="circle", speed_mm_s=600.0, duration_s=15.0)
SLOW = RunPlan(kind="circle", speed_mm_s=100.0, duration_s=15.0)
PLANS = {"low_speed_plateau": SLOW}
SIZES = {"sample_hold": 500.0, "direction_asymmetry": 0.02}  # a loop quicker than the panel repeats events
UNDONE_HERE = [
    name
    for name, home in EFFECTS.items()
    if home.acts_on_touch()
    and (
        home.undone_in in ("touch", OF_SPEED)
        or home.first_shown_s(np.arange(2.0), np.zeros(2), np.zeros(2)) is not None
    )
    and home.follows != "session_time"  # a log does not say how long the screen had been on
]


@lru_cache
def curve() -> CurveFit:
    speed = np.geomspace(40, 1000, 24)
    return fit_form(CurvePoints(speed, RIG.law.latency_s(speed), np.full(24, 1e-4)), "double_exponential")


def model(*effects: Effect) -> LatencyModel:
    size = Provenance(screen_width_mm=RIG.screen.width_mm, screen_height_mm=RIG.screen.height_mm)
    return model_of(curve(), size, [ModelEffect(id=e.id, parameters=e.numbers()) for e in effects])


def of_size(name: str) -> Effect:
    typical = EFFECTS[name].typical()
    return replace(typical, value=SIZES[name]) if name in SIZES else typical


@lru_cache
def recorded(effect: Effect | None, plan: RunPlan) -> tuple[TouchTrace, Motion]:
    (planned,) = expand(Protocol(name="one", runs=(plan,)), RIG.screen, 3, beam=RIG.beam)
    motion = follow(planned.target, Human(), np.random.default_rng(5))
    run = simulate_run(
        RIG, motion, run_id="r", planned=planned, start_s=START_S, rng=np.random.default_rng(7),
        effects=() if effect is None else (effect,),
    )  # fmt: skip
    return run.touch, motion


def away_mm(x_mm: np.ndarray, y_mm: np.ndarray, at_s: np.ndarray, motion: Motion) -> float:
    """RMS distance of places from where the stylus was."""
    true = (np.interp(at_s, START_S + motion.t_s, values) for values in (motion.x_mm, motion.y_mm))
    return float(np.sqrt(np.nanmean(sum((a - b) ** 2 for a, b in zip((x_mm, y_mm), true, strict=True)))))


def compensated(touch: TouchTrace, law: LatencyModel) -> CompensatedEvents:
    return compensate_events(touch.t_s, touch.x_mm, touch.y_mm, law, touch.contact_id)


@pytest.mark.parametrize("name", UNDONE_HERE)
def test_each_effect_that_is_corrected_brings_the_place_nearer_to_the_stylus(name: str) -> None:
    effect = of_size(name)
    touch, motion = recorded(effect, PLANS.get(name, FAST))
    events = compensated(touch, model(effect))
    done, plain = events.done, compensated(touch, model()).done
    off_mm = away_mm(done.x_stylus_mm, done.y_stylus_mm, touch.t_s, motion)
    assert off_mm < 0.95 * away_mm(plain.x_stylus_mm, plain.y_stylus_mm, touch.t_s, motion)
    assert off_mm < 0.3 * away_mm(touch.x_mm, touch.y_mm, touch.t_s, motion)
    assert np.isfinite(done.x_stylus_mm).mean() > 0.97
    np.testing.assert_array_equal(done.latency_s, touch.t_s - done.stylus_t_s)


@pytest.mark.parametrize("name", UNDONE_HERE)
def test_the_way_moved_is_the_path_over_the_latency(name: str) -> None:
    """A place is that of the event whose stylus time it is: where nothing is smoothed, to what a straight line between
    events misses of a circle of 50 mm, v² dt² / 8 r = 0.06 mm, and the jitter of stamps."""
    effect = of_size(name)
    touch, _ = recorded(effect, FAST)
    done = compensated(touch, model(effect)).done
    _, x_mm, y_mm, _ = corrected_touch(touch.t_s, touch.x_mm, touch.y_mm, model(effect))
    forwards = np.append(np.diff(done.stylus_t_s) > 0, True)
    own_s = done.stylus_t_s[forwards]
    for place, shown in ((done.x_stylus_mm, x_mm), (done.y_stylus_mm, y_mm)):
        off_mm = place - np.interp(touch.t_s, own_s, shown[forwards])
        assert np.sqrt(np.nanmean(off_mm**2)) < 0.5


def test_a_rise_of_the_law_at_higher_speeds_leaves_slow_drags_as_they_are() -> None:
    """Below 300 mm/s a second filter does nothing; the law falls there so steeply that events are undone together."""
    effect = of_size("second_filter_mode")
    touch, motion = recorded(effect, SLOW)
    off_mm = [
        away_mm(done.x_stylus_mm, done.y_stylus_mm, touch.t_s, motion)
        for done in (compensated(touch, model(effect)).done, compensated(touch, model()).done)
    ]
    assert off_mm[0] == pytest.approx(off_mm[1], abs=0.01)


def straight(speed_x: float = 20.0, speed_y: float = 100.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    t_s = np.arange(0, 2.5, 1 / 120)
    return t_s, 250 + speed_x * t_s, 20 + speed_y * t_s


def test_half_of_an_asymmetry_is_in_latency_and_place_alike() -> None:
    t_s, x_mm, y_mm = straight()
    law = model(of_size("direction_asymmetry"))
    speed = float(np.hypot(20, 100))
    latency_s = float(RIG.law.latency_s(np.array([speed]))[0]) + 0.5 * 0.02
    done = dl.compensate(t_s, x_mm, y_mm, law)
    placed = slice(20, 275)  # at the ends speeds are of half a window
    np.testing.assert_allclose(done.latency_s[20:-20], latency_s, atol=2e-4)
    np.testing.assert_allclose(done.moved_mm[placed], speed * latency_s, atol=0.03)
    np.testing.assert_allclose(done.x_stylus_mm[placed], (x_mm + 20 * latency_s)[placed], atol=0.03)
    np.testing.assert_allclose(done.y_stylus_mm[placed], (y_mm + 100 * latency_s)[placed], atol=0.03)
    report = done.report()
    np.testing.assert_allclose(report["latency_ms_min_median_max"], 1e3 * latency_s, atol=0.2)  # type: ignore[arg-type]
    assert any("corrected for direction asymmetry" in note for note in done.notes)


def test_an_effect_that_is_left_is_named() -> None:
    done = dl.compensate(*straight(), model(of_size("acceleration_lag"), of_size("clock_drift")))
    plain = dl.compensate(*straight(), curve())
    assert "it follows the acceleration" in done.notes[0]
    assert "it does not act on touch" in done.notes[0]
    np.testing.assert_array_equal(done.x_stylus_mm, plain.x_stylus_mm)
    assert plain.notes == ()


def test_the_last_events_of_a_contact_have_no_place_for_about_a_latency() -> None:
    t_s, x_mm, y_mm = straight()
    done = dl.compensate(t_s, x_mm, y_mm, curve())
    unplaced = np.isnan(done.x_stylus_mm)
    assert unplaced[-unplaced.sum() :].all()
    # One latency, and the event after it.
    assert unplaced.sum() / 120 == pytest.approx(done.latency_s[100], abs=1.5 / 120)


@pytest.mark.parametrize("ids", [("a", "b"), (7, 3)])
def test_contacts_at_a_time_are_taken_one_by_one(ids: tuple[object, object]) -> None:
    first, second = straight(), straight(-30.0, 50.0)
    alone = [dl.compensate(*events, curve()) for events in (first, second)]
    both = [np.column_stack(pair).ravel() for pair in zip(first, second, strict=True)]
    done = dl.compensate(*both, curve(), [ids[0], ids[1]] * first[0].size)
    for name in ("stylus_t_s", "x_stylus_mm", "y_stylus_mm", "moved_mm"):
        np.testing.assert_array_equal(getattr(done, name)[::2], getattr(alone[0], name))
        np.testing.assert_array_equal(getattr(done, name)[1::2], getattr(alone[1], name))


@pytest.mark.parametrize("apart_mm", [15.0, 120.0])
@pytest.mark.parametrize("later_s", [0.0, 0.004])
def test_contacts_that_are_mixed_are_refused(apart_mm: float, later_s: float) -> None:
    t_s, x_mm, y_mm = straight()
    both = [np.column_stack(pair).ravel() for pair in ((t_s, t_s + later_s), (x_mm, x_mm + apart_mm), (y_mm, y_mm))]
    with pytest.raises(
        DataError, match=r"several contacts are mixed. Give the contact of each event, as in dl.compensate"
    ):
        dl.compensate(*both, curve())


@pytest.mark.parametrize("name", [None, "frame_batching", "frame_drop", "sample_hold", "prediction", "lagging_law"])
@pytest.mark.parametrize("plan", [FAST, RunPlan(kind="multisine", duration_s=15.0)])
def test_one_contact_is_not_taken_for_several(name: str | None, plan: RunPlan) -> None:
    assert events_of_several(recorded(None if name is None else of_size(name), plan)[0]) == 0


def test_a_model_s_wrong_units_are_refused_or_said() -> None:
    t_s, x_mm, y_mm = straight()
    for factor in (1e3, 1e6):
        with pytest.raises(DataError, match=r"t_s: the events of a run come one every .* Give all times in seconds"):
            dl.compensate(factor * t_s, x_mm, y_mm, model())
    with pytest.raises(DataError, match=r"t_s holds times that cannot be seconds. Give all times in seconds"):
        dl.compensate(1e12 * t_s, x_mm, y_mm, model())
    for law in (model(), curve()):
        with pytest.raises(DataError, match=r"x_mm reaches 0.3 mm .* Give the positions in mm"):
            dl.compensate(t_s, 1e-3 * x_mm, 1e-3 * y_mm, law)
    in_pixels = dl.compensate(t_s, 3.77 * x_mm, 3.77 * y_mm, model())
    assert re.search(r"of these events reach from 942.* stated to be 509", in_pixels.notes[0])


def test_contacts_of_another_number_are_refused() -> None:
    with pytest.raises(DataError, match=r"times and contacts differ in number. Give one contact_id for each event"):
        dl.compensate(*straight(), curve(), [1, 2])


def test_a_stray_event_is_not_re_timed() -> None:
    t_s, x_mm, y_mm = straight()
    there = np.array(x_mm)
    there[150] = 0.0
    y_there = np.where(np.arange(t_s.size) == 150, 0.0, y_mm)
    done, clean = dl.compensate(t_s, there, y_there, curve()), dl.compensate(t_s, x_mm, y_mm, curve())
    assert np.isnan(done.stylus_t_s[150])
    assert done.x_stylus_mm[150] == pytest.approx(clean.x_stylus_mm[150], abs=0.02)
