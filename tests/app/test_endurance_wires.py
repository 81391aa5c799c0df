"""A long recording loses nothing: field bus at 1 kHz and touch at 120 Hz.

Only with DRAGLAG_ENDURANCE_S (600 before a release), which is its duration.
"""

import json
import os
import subprocess
import sys
import time

import numpy as np
import pytest

from draglag.instruments.clocks import fit_clocks
from draglag.protocol.runs import PlannedRun
from draglag.protocol.targets import Circle
from draglag.store import read_session
from draglag_devices.sim.world import World
from emulators import ethercat
from emulators.play import play_laser, play_touch
from emulators.touch import live

ENDURANCE_S = float(os.environ.get("DRAGLAG_ENDURANCE_S", "0"))
_WHY_NOT = live.why_not() or ethercat.why_not()
pytestmark = [
    pytest.mark.wire,
    pytest.mark.skipif(bool(_WHY_NOT), reason=_WHY_NOT or "-"),
    pytest.mark.skipif(not ENDURANCE_S, reason="set DRAGLAG_ENDURANCE_S (600 before a release)"),
]
# The recorder is up within this; the hand draws from before to after the run.
LEAD_S, TRAIL_S = 2.0, 25.0


def test_nothing_is_lost_in_a_long_recording(tmp_path, capsys):
    protocol = (
        'name = "endurance"\n[[runs]]\nkind = "circle"\nspeeds_mm_s = [250]\nradius_fraction = 0.1\n'
        f"sideways_px_s = 0.3\nduration_s = {ENDURANCE_S}\n"
    )
    (tmp_path / "protocol.toml").write_text(protocol)
    whole_s = LEAD_S + ENDURANCE_S + TRAIL_S
    world = World(seed=11, start_s=time.monotonic())
    circle = Circle(200.0, 140.0, 50.0, 250.0, duration_s=whole_s, sideways_mm_s=100.0 / whole_s)
    with (
        live.LiveTouch(width=10184, height=5728, resolution=20) as panel,
        ethercat.start_segment("long") as segment,
    ):
        world.begin_run(PlannedRun("truth", circle, 250.0, 50.0), time.monotonic() + LEAD_S, "truth")
        truth = world.truth[-1]
        play_laser(truth, 0.0, segment=segment)
        play_touch(panel, truth, 0.0, units_per_mm=20.0)
        command = [sys.executable, "-c", "from draglag_app.cli import main; main()", "record",
                   str(tmp_path / "protocol.toml"), "--touch", f"evdev:{panel.node}", "--laser",
                   f"ethercat:{segment.iface}?channel=1", "--screen", "screen-1", "--display", "offscreen",
                   "--out", str(tmp_path / "session.h5")]  # fmt: skip
        patience_s = 2 * whole_s + 60
        done = subprocess.run(command, env=panel.environment(), capture_output=True, text=True, timeout=patience_s)
    assert done.returncode == 0, done.stdout + done.stderr
    session = read_session(tmp_path / "session.h5")
    run = session.runs[0]
    end_s = run.start_s + run.duration_s
    inside = (truth.laser.t_s >= run.start_s) & (truth.laser.t_s <= end_s)
    recorded = run.laser.t_s[run.laser.t_s <= end_s]
    during = (truth.touch.t_s >= run.start_s) & (truth.touch.t_s <= end_s)
    events = run.touch.t_s[run.touch.t_s <= end_s]
    fit = fit_clocks((*session.clocks, *run.sync))["laser"]
    figures = {
        "seconds": run.duration_s,
        "edges": [len(recorded), int(inside.sum())],
        "edges_missed": run.laser.missed,
        "laser_gaps": len(run.laser.gaps_s),
        "bus_restarts": len(fit.epochs) - 1,
        "touch_events": [len(events), int(during.sum())],
        "touch_dropped": run.touch.dropped,
        "log": [entry.text for entry in run.log if entry.level != "info"],
        "clock_us": [round(1e6 * float(w), 1) for w in np.percentile(
            fit.map_to_host(run.laser.device_t_s, run.laser.epoch)[1], (50, 100))],
    }  # fmt: skip
    with capsys.disabled():
        print("\n" + json.dumps(figures, indent=1))
    assert run.outcome == "complete"
    # A machine that stood still for long enough costs a restart of the bus, which is marked; else nothing is lost.
    dark = run.laser.gaps_s
    lost = [t for t in truth.laser.t_s[inside] if np.abs(run.laser.t_s - t).min() > 1e-3]
    assert [t for t in lost if not ((dark[:, 0] - 1e-3 <= t) & (t <= dark[:, 1] + 1e-3)).any()] == []
    assert run.touch.dropped == 0
    assert len(events) == pytest.approx(during.sum(), abs=2)
