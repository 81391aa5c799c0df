"""What a device clock leaves open reaches the interval, the weights and the reader; an exact clock changes nothing."""

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from draglag.analysis import analyze
from draglag.latency import estimate_on_clock, estimate_run
from draglag.protocol.runs import PlannedRun
from draglag.protocol.targets import Circle, Tap
from draglag.recording import ClockBounds, Session
from draglag.store import write_session
from draglag_app.cli import cli
from draglag_devices.sim.world import World

SPEEDS = (90.0, 250.0, 600.0)


@pytest.fixture(scope="module")
def world():
    made = World(seed=3)
    for k, speed in enumerate(SPEEDS):
        circle = Circle(200.0, made.rig.beam.intercept_mm, 50.0, speed, duration_s=20.0, sideways_mm_s=5.0)
        made.begin_run(PlannedRun(f"run-{k + 1:02d}", circle, speed, 50.0), 10.0 + 30.0 * k, f"run-{k + 1:02d}")
    made.begin_taps(Tap(200.0, 120.0, 30, 0.8), 110.0)
    return made


def bounds(clock, half_s, start_s, end_s, stream="laser", lean=0.0):
    """Exchanges every second that leave the clock open by ``half_s`` to both sides; the truth leans to one."""
    host_s = np.arange(start_s, end_s)
    low = host_s - half_s * (1 + lean)
    return ClockBounds(stream, clock.stamp(host_s), low, low + 2 * half_s, np.zeros(len(host_s), np.int64))


def session(world, half_s, lean=0.0, **changes):
    """Runs as a driver has them: mapped to the middle of its comparisons."""
    runs = []
    for run in world.truth:
        sync = bounds(world.clocks["laser"], half_s, run.start_s - 1, run.start_s + run.duration_s + 2, lean=lean)
        mapped = replace(run.laser, t_s=run.laser.t_s - half_s * lean)
        runs.append(replace(run, laser=mapped, sync=(sync,)))
    made = Session("clocks", world.rig.screen, world.rig.stylus, tuple(runs), beam=world.rig.beam)
    return replace(made, **changes)


@pytest.mark.parametrize(("half_s", "lean"), [(2e-3, 0.9), (2e-3, -0.9), (5e-3, 0.7)])
def test_a_shift_within_the_bounds_stays_within_the_interval(world, half_s, lean):
    diameter = world.rig.stylus.diameter_mm
    for run, true in zip(session(world, half_s, lean).runs, world.truth, strict=True):
        exact = estimate_run(true, diameter)
        found = estimate_on_clock(run, (), diameter)
        assert abs(found.latency_s - exact.latency_s) == pytest.approx(abs(lean) * half_s, rel=0.2)
        assert found.clock_uncertainty_s == pytest.approx(half_s, rel=0.25)
        low, high = found.latency_ci95_s
        assert low < exact.latency_s < high
        assert "clock_uncertain" in found.flags


def test_half_widths_and_standard_error_grow_in_quadrature(world):
    run = session(world, 5e-3).runs[1]
    bare = estimate_run(run, world.rig.stylus.diameter_mm)
    found = estimate_on_clock(run, (), world.rig.stylus.diameter_mm)
    bound_s = found.clock_uncertainty_s
    half_s = (found.latency_ci95_s[1] - found.latency_ci95_s[0]) / 2
    bare_half_s = (bare.latency_ci95_s[1] - bare.latency_ci95_s[0]) / 2
    assert half_s == pytest.approx(np.hypot(bare_half_s, bound_s), rel=0.02)
    assert found.latency_se_s == pytest.approx(np.hypot(bare.latency_se_s, bound_s / np.sqrt(3)), rel=0.02)


def test_clocks_that_are_well_known_change_no_figure(world):
    diameter = world.rig.stylus.diameter_mm
    for run in session(world, 2e-5).runs:
        bare, found = estimate_run(run, diameter), estimate_on_clock(run, (), diameter)
        assert found.latency_ms == pytest.approx(bare.latency_ms, abs=0.03)
        assert found.latency_ci95_ms == pytest.approx(bare.latency_ci95_ms, abs=0.03)
        assert found.flags == bare.flags
        # Without stamps of a device the host's own clock stamped the edges: the very same.
        host = replace(run, laser=replace(run.laser, device_t_s=np.empty(0), epoch=np.empty(0, np.int64)))
        on_host = estimate_on_clock(host, (), diameter)
        assert (on_host.latency_s, on_host.latency_ci95_s) == (bare.latency_s, bare.latency_ci95_s)
        assert on_host.clock_uncertainty_s == 0.0


def test_comparisons_before_and_after_the_run_do_as_well_and_far_ones_are_left_out(world):
    run, clock = replace(world.truth[0], sync=()), world.clocks["laser"]
    around = bounds(clock, 1e-4, run.start_s - 3, run.start_s), bounds(clock, 1e-4, run.start_s + 21, run.start_s + 24)
    found = estimate_on_clock(run, around, world.rig.stylus.diameter_mm)
    assert found.clock_uncertainty_s < 3e-4
    # Two hours later the quartz was warmer; that says nothing about this run.
    later = bounds(clock, 1e-4, run.start_s + 7200, run.start_s + 7210)
    bent = replace(later, host_min_s=later.host_min_s + 0.02, host_max_s=later.host_max_s + 0.02)
    again = estimate_on_clock(run, (*around, bent), world.rig.stylus.diameter_mm)
    assert again.latency_s == found.latency_s
    assert again.clock_uncertainty_s == found.clock_uncertainty_s


def test_stamps_of_a_clock_never_compared_are_flagged(world):
    found = estimate_on_clock(replace(world.truth[0], sync=()), (), world.rig.stylus.diameter_mm)
    assert found.clock_uncertainty_s is None
    assert "clock_unknown" in found.flags
    assert found.to_dict()["clock_uncertainty_ms"] is None


def test_the_warning_reaches_json_text_and_report(world, tmp_path):
    walt = bounds(world.clocks["walt"], 4e-3, 105, 140, "walt")
    path = tmp_path / "wide.h5"
    write_session(session(world, 3e-3, clocks=(walt,), taps=world.true_taps[-1]), path)
    done = CliRunner().invoke(cli, ["analyze", str(path), "--json", "--report", str(tmp_path / "report")])
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    assert [w for w in found["warnings"] if "run-01, run-02, run-03" in w and "±3." in w]
    assert [w for w in found["warnings"] if "WALT's clock shifts the tap latencies by up to ±4." in w]
    assert all("clock_uncertain" in run["flags"] for run in found["runs"])
    assert found["taps"]["touch"]["clock_uncertainty_ms"] == pytest.approx(4, rel=0.1)
    low, high = found["taps"]["touch"]["median_ci95_ms"]
    assert high - low > 8
    page = (tmp_path / "report" / "report.html").read_text("utf-8")
    assert "clock shifts the latency of run-01, run-02, run-03" in page
    said = CliRunner().invoke(cli, ["analyze", str(path)]).output
    assert "Warnings\n" in said
    fine = analyze(session(world, 1e-4))
    assert all("off the curve" in text for text in fine.warnings)  # three runs carry no more than a constant
