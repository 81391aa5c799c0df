"""A recording over real wires (pty, live event device) gives the latency of the world that moved them."""

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from draglag.instruments.clocks import fit_clocks, latency_uncertainty_s
from draglag.instruments.taps import summarise_taps
from draglag.latency import estimate_run
from draglag.protocol.runs import PlannedRun
from draglag.protocol.targets import Circle, Tap
from draglag.store import read_session
from draglag_devices.sim.world import World
from emulators import ethercat
from emulators.play import play_laser, play_taps, play_touch
from emulators.touch import live
from emulators.walt.wires import WaltOnPty

_WHY_NOT = live.why_not()
pytestmark = [pytest.mark.wire, pytest.mark.skipif(bool(_WHY_NOT), reason=_WHY_NOT or "-")]

PATIENCE_S = 60


@pytest.fixture
def panel():
    # The size of screen-1 at 20 units a mm.
    with live.LiveTouch(width=10184, height=5728, resolution=20) as emulated:
        yield emulated


@pytest.fixture
def pen(tmp_path):
    with WaltOnPty(tmp_path, drift=14e-6) as emulated:
        yield emulated


def recorder(panel, tmp_path: Path, protocol: str, *arguments: str) -> subprocess.Popen:
    """``draglag record`` in a process that sees the panel."""
    (tmp_path / "protocol.toml").write_text(f'name = "wires"\nrest_s = 0.5\n{protocol}')
    command = [sys.executable, "-c", "from draglag_app.cli import main; main()", "record",
               str(tmp_path / "protocol.toml"), "--touch", f"evdev:{panel.node}", "--screen", "screen-1",
               "--display", "offscreen", "--out", str(tmp_path / "session.h5"), *arguments]  # fmt: skip
    return subprocess.Popen(command, env=panel.environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@pytest.fixture(params=["walt", "ethercat"])
def laser(request, pen):
    """Arguments for ``record`` and where edges are played: the WALT's laser, or the field bus next to a WALT."""
    if request.param == "walt":
        yield ("--laser", f"serial:{pen.path}?role=laser"), {"walt": pen}
        return
    reason = ethercat.why_not()
    if reason:
        pytest.skip(reason)
    with ethercat.start_segment("wires") as segment:
        addresses = ("--laser", f"ethercat:{segment.iface}?channel=1", "--walt", f"serial:{pen.path}")
        yield addresses, {"segment": segment}


def test_a_circle_over_touch_and_laser_has_the_latency_of_the_world(panel, laser, tmp_path):
    addresses, played = laser
    protocol = '[[runs]]\nkind = "circle"\nspeeds_mm_s = [200]\nradius_fraction = 0.1\nduration_s = 5.0\n'
    world = World(seed=5, start_s=time.monotonic())
    # The hand draws all the time; the recording takes its part of it, whenever it begins.
    circle = Circle(150.0, 140.0, 50.0, 200.0, duration_s=24.0, sideways_mm_s=12.0)
    world.begin_run(PlannedRun("truth", circle, 200.0, 50.0), time.monotonic() + 0.5, "truth")
    play_laser(world.truth[-1], 0.0, **played)
    play_touch(panel, world.truth[-1], 0.0, units_per_mm=20.0)
    process = recorder(panel, tmp_path, protocol, *addresses)
    out, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, out + err
    session = read_session(tmp_path / "session.h5")
    run = session.runs[0]
    truth = world.truth[-1]
    inside = (truth.laser.t_s >= run.start_s) & (truth.laser.t_s <= run.start_s + run.duration_s + 0.5)
    assert run.outcome == "complete"
    assert run.laser.missed == 0
    assert len(run.laser.t_s) == inside.sum() > 10
    assert run.laser.light.tolist() == truth.laser.light[inside].tolist()
    # Every edge is where it happened, to the uncertainty that the clocks claim.
    bound_s = latency_uncertainty_s(run, session.clocks)
    assert bound_s is not None
    fit = fit_clocks((*session.clocks, *run.sync))["laser"]
    host_s, width_s = fit.map_to_host(run.laser.device_t_s, run.laser.epoch)
    assert (np.abs(host_s - truth.laser.t_s[inside]) <= width_s + 2e-6).all()
    # Compared in full, seven rows within a second or so, before the target moved and after it stopped.
    if "walt" in played:
        compared_s = np.concatenate([part.host_max_s for part in run.sync if part.stream == "laser"])
        assert (compared_s < run.start_s + 0.5).sum() >= 7
        assert (compared_s > run.start_s + run.duration_s).sum() >= 7
    # No touch event lost, none invented.
    during = (truth.touch.t_s >= run.start_s) & (truth.touch.t_s <= run.start_s + run.duration_s + 0.5)
    assert len(run.touch.t_s) == pytest.approx(during.sum(), abs=2)
    assert run.touch.dropped == 0
    # The same latency as from the world's own data of the same stretch.
    measured = estimate_run(run, world.rig.stylus.diameter_mm)
    direct = estimate_run(truth, world.rig.stylus.diameter_mm)
    assert measured.latency_ms == pytest.approx(direct.latency_ms, abs=3.0)


def test_taps_over_touch_and_walt_have_the_latency_of_the_world(panel, pen, tmp_path):
    world = World(seed=6, start_s=time.monotonic())
    process = recorder(panel, tmp_path, "[taps]\ncount = 6\ninterval_s = 0.6\n", "--walt", f"serial:{pen.path}")
    world.begin_taps(Tap(150.0, 120.0, 22, 0.6), time.monotonic() + 0.5)
    play_taps(panel, pen, world.true_taps[-1], 0.0)
    out, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, out + err
    session = read_session(tmp_path / "session.h5")
    taps = session.taps
    assert taps is not None
    assert (taps.down == 1).sum() >= 6
    true = world.true_taps[-1]
    latency = {at: seen - at for at, seen in zip(true.physical_s.tolist(), true.registered_s.tolist(), strict=True)}
    width_s = min(float(np.min(part.host_max_s - part.host_min_s)) for part in session.clocks)
    for at_s, seen_s in zip(taps.physical_s.tolist(), taps.registered_s.tolist(), strict=True):
        nearest = min(latency, key=lambda t: abs(t - at_s))
        assert seen_s - at_s == pytest.approx(latency[nearest], abs=max(10 * width_s, 2e-3))
    assert set(summarise_taps(taps)) == {"touch", "release"}
