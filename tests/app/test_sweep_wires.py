"""A latency sweep over all three emulated instruments, compared with the same sweep in process (``sim:``).

The recording announces each target; the world's hand follows it, and reaches the touchscreen (umockdev), the laser on
the field bus (veth) and the WALT (pty) with stamps set beforehand, so that load changes nothing. With the same seed,
panel resolution and clock uncertainty are the only differences. ``pytest -s`` shows the tables.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import emulators
from draglag.analysis import Analysis, AnalysisOptions, analyze
from draglag.instruments.clocks import fit_clocks
from draglag.instruments.taps import summarise_taps
from draglag.protocol.runs import expand, load_protocol
from draglag.protocol.targets import Tap
from draglag.recording import Run, Session, Taps
from draglag.store import read_session
from draglag_app.cli.record import session_options
from draglag_app.session import OffscreenDisplay, run_session
from draglag_devices.rig import make_rig
from draglag_devices.sim.world import World
from draglag_devices.walt.link import ANSWER_S, SETTLE_S
from emulators import ethercat
from emulators.play import play_laser, play_taps, play_touch
from emulators.touch import live
from emulators.walt.wires import WaltOnPty

_WHY_NOT = live.why_not() or ethercat.why_not()
pytestmark = [pytest.mark.wire, pytest.mark.skipif(bool(_WHY_NOT), reason=_WHY_NOT or "-")]

UNITS_PER_MM = 20
SEED = 21
TAPS, INTERVAL_S = 4, 2.4
PROTOCOL = f"""
name = "sweep"
rest_s = 0.2
[[runs]]
kind = "circle"
speeds_mm_s = [80, 130, 220]
radius_fraction = 0.04
duration_s = 5.0
sideways_px_s = 40
[[runs]]
kind = "circle"
speeds_mm_s = [360, 600, 900]
radius_fraction = 0.1
duration_s = 4.0
sideways_px_s = 40
[taps]
count = {TAPS}
interval_s = {INTERVAL_S}
when = "end"
"""
RUNS = 6
PATIENCE_S = 120.0
# The stylus rests so much longer on the screen than a quick tap: the WALT keeps one shock until it is asked, and a
# host that is held up asks late.
HOLD_S = 0.75
# Whole units of the panel in place of exact mm: ±0.025 mm on top of 0.1 mm of noise moves an estimate by a small part
# of its own interval.
OF_INTERVAL = 0.3


@dataclass(frozen=True)
class Sweep:
    """The session over the wires, the world that moved them, and the session of the same seed in process.

    ``shocks_s``: of the taps; ``unfelt_s``: those the WALT could not keep, as nobody had asked for the one before.
    """

    wires: Session
    world: World
    shocks_s: np.ndarray
    unfelt_s: np.ndarray
    sim: Session
    found: Analysis
    expected: Analysis


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: pytest.TempPathFactory) -> Sweep:
    folder: Path = tmp_path_factory.mktemp("sweep")
    (folder / "sweep.toml").write_text(PROTOCOL)
    world, unfelt_s = over_wires(folder)
    rig = make_rig(dict.fromkeys(("touch", "laser", "walt"), "sim:"), "screen-1", SEED, fast=True)
    options = session_options(rig, "screen-1", None)
    run_session(load_protocol(folder / "sweep.toml"), rig, OffscreenDisplay(), folder / "sim.h5", options)
    wires, sim = read_session(folder / "sweep.h5"), read_session(folder / "sim.h5")
    as_eq_5 = AnalysisOptions(form="double_exponential")
    taps = world.true_taps[-1]
    shocks_s = taps.physical_s + np.where(taps.down == 1, 0.0, HOLD_S)
    return Sweep(wires, world, shocks_s, unfelt_s, sim, analyze(wires, as_eq_5), analyze(sim, as_eq_5))


def over_wires(folder: Path) -> tuple[World, np.ndarray]:
    """The world that moved the instruments, and shocks the WALT could not keep, s; the recording is ``sweep.h5`` in
    ``folder``."""
    world = World(seed=SEED, start_s=time.monotonic())
    screen = world.rig.screen
    coming = list(expand(load_protocol(folder / "sweep.toml"), screen, beam=world.rig.beam))
    # The panel does not say how large it is: the session gives it.
    size = {"width": round(screen.width_mm * UNITS_PER_MM), "height": round(screen.height_mm * UNITS_PER_MM)}
    with (
        live.LiveTouch(**size, resolution=0) as panel,
        ethercat.start_segment("sweep") as segment,
        WaltOnPty(folder, drift=14e-6) as pen,
        open(folder / "complaints", "w+") as complaints,
    ):
        segment.edges([(0, 1, 1)])  # the beam is on the sensor
        command = [sys.executable, str(Path(emulators.__path__[0]) / "recorder.py"), str(folder / "sweep.toml"),
                   "screen-1", str(folder / "sweep.h5"), f"touch=evdev:{panel.node}",
                   f"laser=ethercat:{segment.iface}?channel=1", f"walt=serial:{pen.path}"]  # fmt: skip
        process = subprocess.Popen(
            command, env=panel.environment(), stdout=subprocess.PIPE, stderr=complaints, text=True
        )
        for line in process.stdout:
            shown = json.loads(line)
            if shown["kind"] == "tap":
                world.begin_taps(Tap(screen.width_mm / 2, screen.height_mm / 2, TAPS, INTERVAL_S), shown["start_s"])
                play_taps(panel, pen, world.true_taps[-1], 0.0, hold_s=HOLD_S)
            else:
                planned = coming.pop(0)
                world.begin_run(planned, shown["start_s"], planned.id)
                play_laser(world.truth[-1], 0.0, segment=segment)
                play_touch(panel, world.truth[-1], 0.0, units_per_mm=UNITS_PER_MM)
            assert time.monotonic() < shown["start_s"], "this machine stood still: the hand was informed too late"
        process.wait(PATIENCE_S)
        process.stdout.close()
        complaints.seek(0)
        assert process.returncode == 0, complaints.read()
        assert panel.do("state")["trouble"] == ""
    return world, np.array(pen.firmware.unfelt)


def half_ms(interval_ms: tuple[float, float]) -> float:
    return (interval_ms[1] - interval_ms[0]) / 2


def test_every_touch_event_and_every_edge_arrives(sweep: Sweep) -> None:
    assert [run.outcome for run in sweep.wires.runs] == ["complete"] * RUNS
    for run, truth in zip(sweep.wires.runs, sweep.world.truth, strict=True):
        assert run.touch.dropped == 0
        assert run.touch.t_s == pytest.approx(truth.touch.t_s, abs=2e-6)
        assert run.touch.x_mm == pytest.approx(truth.touch.x_mm, abs=0.51 / UNITS_PER_MM)
        assert run.touch.y_mm == pytest.approx(truth.touch.y_mm, abs=0.51 / UNITS_PER_MM)
        unseen, unmarked = lost_edges(run, truth, sweep.wires)
        if len(run.laser.gaps_s):
            # A machine that stood still may cost the bus a restart: what was lost meanwhile is marked.
            assert unmarked <= run.laser.missed
        else:
            assert unseen == run.laser.missed


def lost_edges(run: Run, truth: Run, session: Session) -> tuple[int, int]:
    """True edges that were not recorded: all, and those outside marked gaps. The others are where they happened."""
    fit = fit_clocks((*session.clocks, *run.sync))["laser"]
    host_s, width_s = fit.map_to_host(run.laser.device_t_s, run.laser.epoch)
    seen = np.zeros(len(truth.laser.t_s), bool)
    for at_s, within_s, light in zip(host_s, width_s, run.laser.light, strict=True):
        k = int(np.argmin(np.abs(truth.laser.t_s - at_s)))
        assert abs(truth.laser.t_s[k] - at_s) <= within_s + 2e-6
        assert light == truth.laser.light[k]
        assert not seen[k]
        seen[k] = True
    dark = run.laser.gaps_s
    marked = [bool(((dark[:, 0] - 1e-3 <= t) & (t <= dark[:, 1] + 1e-3)).any()) for t in truth.laser.t_s]
    return int((~seen).sum()), int((~seen & ~np.array(marked)).sum())


def test_every_run_has_the_latency_of_the_same_run_in_process(sweep: Sweep) -> None:
    print(f"\n{'run':8}{'mm/s':>7}{'wires ms':>10}{'sim ms':>9}{'diff':>8}{'± wires':>9}{'± sim':>8}{'± clocks':>10}")
    allowed, pairs = [], list(zip(sweep.found.runs, sweep.expected.runs, strict=True))
    for run, (found, expected) in zip(sweep.wires.runs, pairs, strict=True):
        own, others = half_ms(found.latency_ci95_ms), half_ms(expected.latency_ci95_ms)
        clocks_ms = 1e3 * (found.clock_uncertainty_s + expected.clock_uncertainty_s)
        print(
            f"{found.id:8}{found.speed_mm_s:7.0f}{found.latency_ms:10.3f}{expected.latency_ms:9.3f}"
            f"{found.latency_ms - expected.latency_ms:8.3f}{own:9.3f}{others:8.3f}{clocks_ms:10.3f}"
        )
        # The same edges and touches: as good as equal. Fewer edges make an estimate of their own.
        same = run.laser.missed == 0 and not len(run.laser.gaps_s)
        allowed.append(clocks_ms + (OF_INTERVAL * min(own, others) if same else np.hypot(own, others)))
    for (found, expected), allowed_ms in zip(pairs, allowed, strict=True):
        assert abs(found.latency_ms - expected.latency_ms) <= allowed_ms, found.id
        assert found.nominal_speed_mm_s == expected.nominal_speed_mm_s
        own, clocks_ms = half_ms(found.latency_ci95_ms), 1e3 * found.clock_uncertainty_s
        # And the law the world is made of is what the wires found.
        law_ms = 1e3 * float(sweep.world.rig.law.latency_s(np.array([found.speed_mm_s]))[0])
        assert abs(found.latency_ms - law_ms) <= 2 * own + clocks_ms + 1.0


def test_the_curve_is_the_curve_of_the_simulator(sweep: Sweep) -> None:
    found, expected = sweep.found.curve, sweep.expected.curve
    assert found is not None
    assert expected is not None
    assert found.form == expected.form == "double_exponential"
    assert found.n_points == expected.n_points == RUNS
    low, high = zip(found.speed_range_mm_s, expected.speed_range_mm_s, strict=True)
    speed = np.geomspace(max(low), min(high), 9)
    wires_ms, sim_ms = 1e3 * found.predict_s(speed), 1e3 * expected.predict_s(speed)
    bands_ms = [1e3 * np.array(curve.band_s(speed)) for curve in (found, expected)]
    print(f"\n{'mm/s':>8}{'wires ms':>10}{'sim ms':>9}{'diff':>8}{'band of wires':>19}{'band of sim':>19}")
    for k, v in enumerate(speed):
        bands = "".join(f"{band[0, k]:10.2f} …{band[1, k]:7.2f}" for band in bands_ms)
        print(f"{v:8.0f}{wires_ms[k]:10.3f}{sim_ms[k]:9.3f}{wires_ms[k] - sim_ms[k]:8.3f}{bands}")
    clocks_ms = 1e3 * max(run.clock_uncertainty_s for run in (*sweep.found.runs, *sweep.expected.runs))
    for curve_ms, band in ((wires_ms, bands_ms[1]), (sim_ms, bands_ms[0])):
        assert (band[0] - clocks_ms <= curve_ms).all()
        assert (curve_ms <= band[1] + clocks_ms).all()


def test_taps_have_the_latency_of_the_same_taps_in_process(sweep: Sweep) -> None:
    assert sweep.wires.taps is not None
    # A machine that stands still for longer than a tap does not ask for its first shock in time: what the WALT then
    # could not keep is counted, and nothing else, but where the WALT was reported as gone.
    lost = sweep.wires.taps.rejected
    away_s = walt_away_s(sweep.wires)
    possible = int((~within(sweep.unfelt_s, away_s)).sum() + within(sweep.shocks_s, away_s).sum())
    assert len(sweep.unfelt_s) <= sum(lost.values()) <= possible, (lost, sweep.wires.notes)
    assert set(lost) <= {"touch", "release"}
    found, expected = summarise_taps(sweep.wires.taps), summarise_taps(sweep.sim.taps)
    # The pty's clock is known to about a tenth of a millisecond, and less well on a busy machine.
    walt = [part for part in sweep.wires.clocks if part.stream == "walt"]
    width_s = min(float(np.min(part.host_max_s - part.host_min_s)) for part in walt)
    print(f"\n{'taps':9}{'n':>3}{'wires ms':>10}{'sim ms':>9}")
    for kind in ("touch", "release"):
        print(f"{kind:9}{found[kind].n:3}{1e3 * found[kind].median_s:10.3f}{1e3 * expected[kind].median_s:9.3f}")
    for kind in ("touch", "release"):
        assert expected[kind].n == TAPS
        assert found[kind].n == TAPS - lost.get(kind, 0)
        within_s = max(10 * width_s, 2e-3)
        own, others = (tap_latencies_s(taps, kind) for taps in (sweep.wires.taps, sweep.sim.taps))
        assert (np.abs(own[:, None] - others).min(axis=1) <= within_s).all()
        if not lost.get(kind):
            assert found[kind].median_s == pytest.approx(expected[kind].median_s, abs=within_s)


def walt_away_s(session: Session) -> list[tuple[float, float]]:
    """From when to when the WALT was away, by the session's notes.

    An emulated WALT stops with its process: its answers then reach a port given up, and later shocks have another
    clock's stamps.
    """
    walt = [note for note in session.notes if note.source == "walt"]
    gone_s = [note.t_s for note in walt if "is gone" in note.text]
    back_s = [note.t_s for note in walt if "is back" in note.text]
    # It is reported after one question and two pings without an answer; the question before may be half a second old.
    silent_s = ANSWER_S + 2 * SETTLE_S + 0.5
    return [(gone - silent_s, back) for gone, back in zip(gone_s, [*back_s, np.inf], strict=False)]


def within(t_s: np.ndarray, spans_s: list[tuple[float, float]]) -> np.ndarray:
    """Which times lie in one of the spans, (n,) bool."""
    inside = np.zeros(len(t_s), bool)
    for from_s, to_s in spans_s:
        inside |= (from_s <= t_s) & (t_s <= to_s)
    return inside


def tap_latencies_s(taps: Taps, kind: str) -> np.ndarray:
    """Of the touches or the releases."""
    return (taps.registered_s - taps.physical_s)[taps.down == int(kind == "touch")]


def test_clocks_were_compared_around_each_block(sweep: Sweep) -> None:
    for run in sweep.wires.runs:
        if len(run.laser.gaps_s):
            continue  # while the bus is away there is nothing to compare with
        laser = next(part for part in run.sync if part.stream == "laser")
        assert laser.host_min_s.min() <= run.start_s
        assert laser.host_max_s.max() >= run.start_s + run.duration_s
    walt = [part for part in sweep.wires.clocks if part.stream == "walt"]
    taps = sweep.wires.taps.physical_s
    compared_s = np.concatenate([part.host_max_s for part in walt])
    # The full comparison is seven rows within a second.
    assert (np.abs(compared_s - taps.min()) < 6).sum() >= 7
    assert (compared_s > taps.max()).sum() >= 7
