"""The simulated world: its sources report exactly what happened in it, on clocks of their own."""

import numpy as np
import pytest

from draglag.protocol.runs import PlannedRun
from draglag.protocol.targets import Circle, Tap
from draglag.recording import ClockBounds
from draglag_devices.clockmap import OnlineClockMap
from draglag_devices.rig import make_rig
from draglag_devices.sim.clocks import DeviceClock
from draglag_devices.timebase import HostTime
from draglag_devices.timeline import CHUNK_S

PLANNED = PlannedRun("run-01", Circle(200, 143, 50, 300, 6.0), 300.0, 50.0)


def opened(seed=0, **options):
    rig = make_rig(dict.fromkeys(("touch", "laser", "walt"), "sim:"), "screen-1", seed, True, **options)
    for source in rig.sources:
        source.open()
    return rig, rig.stage.players["sim"], {source.role: source for source in rig.sources}


def read_until(source, t_s):
    batches = [source.read(0.0)]
    while batches[-1].until_s < t_s:
        batches.append(source.read(0.0))
    return batches


def column(batches, kind, name):
    return np.concatenate([getattr(getattr(b, kind), name) for b in batches if getattr(b, kind) is not None])


def test_sources_deliver_all_that_happened_once_and_in_order():
    rig, world, sources = opened()
    rig.stage.begin_run(PLANNED, 3.0, "run-01")
    rig.stage.time_base.advance_to(12.0)
    touch, laser = read_until(sources["touch"], 12.0), read_until(sources["laser"], 12.0)
    truth = world.truth[0]
    assert len(truth.laser.t_s) > 10
    np.testing.assert_array_equal(column(touch, "touch", "t_s"), truth.touch.t_s)
    np.testing.assert_array_equal(column(touch, "touch", "x_mm"), truth.touch.x_mm)
    np.testing.assert_array_equal(column(laser, "laser", "device_t_s"), truth.laser.device_t_s)
    np.testing.assert_array_equal(column(laser, "laser", "light"), truth.laser.light)


def test_nothing_is_known_before_its_time():
    rig, _, sources = opened()
    rig.stage.begin_run(PLANNED, 1.0, "run-01")
    rig.stage.time_base.advance_to(4.0)
    for batch in read_until(sources["touch"], 4.0):
        assert batch.touch is None or batch.touch.t_s.max() <= batch.until_s
    before = sources["touch"].read(0.0)
    assert before.until_s == 4.0
    assert before.touch is None


def test_simulated_time_comes_in_chunks():
    rig, _, sources = opened()
    rig.stage.time_base.advance_to(1.0)
    assert [sources["touch"].read(0.0).until_s for _ in range(4)] == pytest.approx(np.arange(1, 5) * CHUNK_S)


def test_edges_mapped_while_recording_are_within_the_bounds_of_the_clocks():
    rig, world, sources = opened(seed=4)
    rig.stage.begin_run(PLANNED, 3.0, "run-01")
    rig.stage.time_base.advance_to(12.0)
    laser = read_until(sources["laser"], 12.0)
    error_s = column(laser, "laser", "t_s") - world.truth[0].laser.t_s
    clock = world.clocks["laser"]
    assert abs(clock.offset_s) > 1  # there was something to map
    # Each bound is up to 400 us wide and the device is somewhere inside.
    assert np.abs(error_s).max() < 4e-4
    bounds = [b.clock for b in laser if b.clock is not None]
    for pair in bounds:
        host_s = (pair.device_s - clock.offset_s) / (1 + clock.drift)
        assert ((pair.host_min_s <= host_s + 1e-9) & (host_s <= pair.host_max_s + 1e-9)).all()


def test_the_same_seed_gives_the_same_world():
    runs = []
    for _ in range(2):
        rig, world, _ = opened(seed=9)
        rig.stage.begin_run(PLANNED, 3.0, "run-01")
        runs.append(world.truth[0])
    np.testing.assert_array_equal(runs[0].touch.x_mm, runs[1].touch.x_mm)
    np.testing.assert_array_equal(runs[0].laser.device_t_s, runs[1].laser.device_t_s)


def test_a_stopped_hand_reports_nothing_more_and_the_next_run_is_whole():
    rig, world, sources = opened()
    rig.stage.begin_run(PLANNED, 1.0, "run-01")
    rig.stage.time_base.advance_to(3.0)
    first = read_until(sources["touch"], 3.0)
    rig.stage.stop()
    rig.stage.begin_run(PLANNED, 20.0, "run-02")
    rig.stage.time_base.advance_to(30.0)
    later = read_until(sources["touch"], 30.0)
    assert column(first, "touch", "t_s").max() <= 3.0
    np.testing.assert_array_equal(column(later, "touch", "t_s"), world.truth[1].touch.t_s)
    assert not set(world.truth[0].touch.contact_id) & set(world.truth[1].touch.contact_id)


def test_the_walt_feels_each_tap_and_the_panel_reports_it_later():
    rig, world, sources = opened()
    rig.stage.begin_taps(Tap(250, 143, 10, 0.8), 2.0)
    rig.stage.time_base.advance_to(12.0)
    walt, touch = read_until(sources["walt"], 12.0), read_until(sources["touch"], 12.0)
    truth = world.true_taps[0]
    assert np.abs(column(walt, "taps", "physical_s") - truth.physical_s).max() < 4e-4
    assert np.isnan(column(walt, "taps", "registered_s")).all()
    np.testing.assert_array_equal(column(touch, "contacts", "t_s"), truth.registered_s)
    assert column(touch, "contacts", "down").tolist() == [1, 0] * 10


def test_in_real_time_a_read_ends_and_its_watermark_moves_on():
    rig = make_rig({"touch": "sim:"}, fast=False)
    assert isinstance(rig.stage.time_base, HostTime)
    source = rig.sources[0]
    source.open()
    first, second = source.read(0.01), source.read(0.01)
    assert second.until_s >= first.until_s


def test_a_clock_map_forgets_the_clock_before_a_restart():
    before, after = DeviceClock(100.0, 1e-5), DeviceClock(0.0, 1e-5)
    rng = np.random.default_rng(0)
    clock_map = OnlineClockMap()
    assert not clock_map.ready
    clock_map.add(before.bounds("laser", np.arange(10.0), rng))
    later = after.bounds("laser", np.arange(20.0, 40.0), rng)
    clock_map.add(ClockBounds("laser", later.device_s, later.host_min_s, later.host_max_s, np.ones(20, np.int64)))
    t_s = np.array([21.0, 39.0])
    np.testing.assert_allclose(clock_map.to_host(after.stamp(t_s)), t_s, atol=2e-4)


def test_a_clock_map_follows_drift():
    clock = DeviceClock(5.0, 2e-5)
    clock_map = OnlineClockMap()
    clock_map.add(clock.bounds("laser", np.arange(0.0, 100.0), np.random.default_rng(1)))
    # Ignoring the drift would be 1 ms off at the ends.
    np.testing.assert_allclose(clock_map.to_host(clock.stamp(np.array([0.0, 100.0]))), [0.0, 100.0], atol=1e-4)
