"""A latency sweep over all three emulated instruments at once, moved by one world, against that world's own data.

The recording leads: whenever it shows a target, the world's hand follows it, and what the hand does reaches the
touchscreen (umockdev), the laser on the field bus (veth) and the WALT (pty). ``pytest -s`` shows the table.

The hand must follow the target within milliseconds, so it runs where the machine is nobody else's:
``DRAGLAG_SWEEP=1 ./run test -s tests/app/test_sweep_wires.py`` (about 40 s).
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import emulators
from draglag.analysis import analyze
from draglag.latency import estimate_run
from draglag.protocols import expand, load_protocol
from draglag.store import read_session
from draglag.taps import summarise_taps
from draglag.targets import Tap
from draglag_devices.sim.world import World
from emulators import ethercat
from emulators.play import play_laser, play_taps, play_touch
from emulators.touch import live
from emulators.walt.wires import WaltOnPty

_WHY_NOT = live.why_not() or ethercat.why_not()
if not _WHY_NOT and not os.environ.get("DRAGLAG_SWEEP"):
    _WHY_NOT = "needs a machine that is nobody else's: set DRAGLAG_SWEEP=1"
pytestmark = [pytest.mark.wire, pytest.mark.skipif(bool(_WHY_NOT), reason=_WHY_NOT or "-")]

UNITS_PER_MM = 20
PROTOCOL = """
name = "sweep"
rest_s = 0.2
[[runs]]
kind = "circle"
speeds_mm_s = [120, 350, 800]
radius_fraction = 0.1
duration_s = 6.0
sideways_px_s = 40
[taps]
count = 6
interval_s = 0.6
when = "end"
"""
PATIENCE_S = 120.0


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory):
    folder: Path = tmp_path_factory.mktemp("sweep")
    (folder / "sweep.toml").write_text(PROTOCOL)
    world = World(seed=21, start_s=time.monotonic())
    screen = world.rig.screen
    plan = expand(load_protocol(folder / "sweep.toml"), screen, beam=world.rig.beam)
    # The panel does not say how large it is: the session tells it.
    size = {"width": round(screen.width_mm * UNITS_PER_MM), "height": round(screen.height_mm * UNITS_PER_MM)}
    with (
        live.LiveTouch(**size, resolution=0) as panel,
        ethercat.start_segment("sweep") as segment,
        WaltOnPty(folder, drift=14e-6) as pen,
    ):
        segment.edges([(0, 1, 1)])  # the beam is on the sensor
        command = [sys.executable, str(Path(emulators.__path__[0]) / "recorder.py"), str(folder / "sweep.toml"),
                   "screen-1", str(folder / "sweep.h5"), f"touch=evdev:{panel.node}",
                   f"laser=ethercat:{segment.iface}?channel=1", f"walt=serial:{pen.path}"]  # fmt: skip
        with open(folder / "complaints", "w+") as complaints:
            process = subprocess.Popen(
                command, env=panel.environment(), stdout=subprocess.PIPE, stderr=complaints, text=True
            )
            coming = list(plan)
            for line in process.stdout:
                shown = json.loads(line)
                if shown["kind"] == "tap":
                    world.begin_taps(Tap(screen.width_mm / 2, screen.height_mm / 2, 6, 0.6), shown["start_s"])
                    play_taps(panel, pen, world.true_taps[-1], 0.0)
                    continue
                planned = coming.pop(0)
                world.begin_run(planned, shown["start_s"], planned.id)
                play_laser(world.truth[-1], 0.0, segment=segment)
                play_touch(panel, world.truth[-1], 0.0, units_per_mm=UNITS_PER_MM)
            process.wait(PATIENCE_S)
            complaints.seek(0)
            assert process.returncode == 0, complaints.read()
            process.stdout.close()
    return read_session(folder / "sweep.h5"), world


def test_every_run_has_the_latency_of_the_world(swept):
    session, world = swept
    diameter = world.rig.stylus.diameter_mm
    analysis = analyze(session)
    assert [run.outcome for run in session.runs] == ["complete"] * 3
    print(f"\n{'run':8}{'mm/s':>7}{'wires ms':>10}{'world ms':>10}{'diff':>8}{'clock ±':>9}{'95 % ±':>8}  edges")
    for run, found, truth in zip(session.runs, analysis.runs, world.truth, strict=True):
        direct = estimate_run(truth, diameter)
        half_ms = (direct.latency_ci95_ms[1] - direct.latency_ci95_ms[0]) / 2
        clock_ms = 1e3 * found.clock_uncertainty_s
        difference_ms = found.latency_ms - direct.latency_ms
        print(
            f"{run.id:8}{found.speed_mm_s:7.0f}{found.latency_ms:10.3f}{direct.latency_ms:10.3f}{difference_ms:8.3f}"
            f"{clock_ms:9.3f}{half_ms:8.3f}  {len(run.laser.t_s)}/{len(truth.laser.t_s)}"
        )
        assert run.touch.dropped == 0
        assert len(run.touch.t_s) == len(truth.touch.t_s)
        # A machine that stood still may cost the bus a restart, which is marked.
        if not len(run.laser.gaps_s):
            assert len(run.laser.t_s) == len(truth.laser.t_s)
        assert abs(difference_ms) <= clock_ms + half_ms
        # And the law the world is made of is what the wires found.
        law_ms = 1e3 * float(world.rig.law.latency_s(np.array([found.speed_mm_s]))[0])
        assert abs(found.latency_ms - law_ms) <= 2 * half_ms + clock_ms + 1.0


def test_taps_have_the_latency_of_the_world(swept):
    session, world = swept
    found, true = summarise_taps(session.taps), summarise_taps(world.true_taps[-1])
    for kind in ("touch", "release"):
        assert found[kind].n == true[kind].n == 6
        # The pty's clock is known to about a tenth of a millisecond, and more on a busy machine.
        walt = [part for part in session.clocks if part.stream == "walt"]
        width_s = min(float(np.min(part.host_max_s - part.host_min_s)) for part in walt)
        assert found[kind].median_s == pytest.approx(true[kind].median_s, abs=max(10 * width_s, 2e-3))


def test_clocks_were_compared_around_each_block(swept):
    session, _ = swept
    for run in session.runs:
        laser = next(part for part in run.sync if part.stream == "laser")
        assert laser.host_min_s.min() <= run.start_s
        assert laser.host_max_s.max() >= run.start_s + run.duration_s
    walt = [part for part in session.clocks if part.stream == "walt"]
    taps = session.taps.physical_s
    compared_s = np.concatenate([part.host_max_s for part in walt])
    # The full comparison is seven rows within a second.
    assert (np.abs(compared_s - taps.min()) < 6).sum() >= 7
    assert (compared_s > taps.max()).sum() >= 7
