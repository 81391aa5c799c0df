"""Simulated recordings of runs and sessions."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from draglag.protocol.runs import PlannedRun, Protocol, expand, load_protocol
from draglag.recording import (
    ClockBounds,
    DisplayTrace,
    FloatArray,
    LaserTrace,
    Run,
    Session,
    Taps,
    TouchTrace,
    concatenate,
)
from draglag.simulation.digitiser import reporting, touch_events
from draglag.simulation.effects.base import Effect
from draglag.simulation.hand import Human, follow
from draglag.simulation.kinematics import Kinematics, Motion
from draglag.simulation.law import LatencyLaw
from draglag.simulation.rig import Rig, rig_for_screen
from draglag.simulation.sensor import sensor_edges, shadow_edges
from draglag.simulation.taps import simulate_taps

FRAME_HZ = 60.0


@dataclass(frozen=True)
class RunTruth:
    """True edges of one run, (m,) each, on the host clock."""

    edge_s: FloatArray
    latency_s: FloatArray
    speed_mm_s: FloatArray

    @property
    def mean_latency_s(self) -> float:
        """Mean over the edges; NaN without any."""
        return float(self.latency_s.mean()) if len(self.latency_s) else float("nan")

    @property
    def mean_speed_mm_s(self) -> float:
        """Mean over the edges; NaN without any."""
        return float(self.speed_mm_s.mean()) if len(self.speed_mm_s) else float("nan")


@dataclass(frozen=True)
class SimulationTruth:
    """Truth behind a simulated session."""

    law: LatencyLaw
    effects: tuple[Effect, ...]
    runs: Mapping[str, RunTruth]


class _Streams:
    """Independent random generators by name, from one draw."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._seed = int(rng.integers(2**62))

    def __call__(self, name: str) -> np.random.Generator:
        return np.random.default_rng([self._seed, zlib.crc32(name.encode())])


def clock_bounds(
    rig: Rig, t_s: FloatArray, effects: Sequence[Effect], rng: np.random.Generator, session_start_s: float
) -> ClockBounds:
    """Comparisons of laser and host clock at session times ``t_s``."""
    before, after = rng.uniform(0.1, 0.9, len(t_s)) * rig.clock_width_s, np.full(len(t_s), rig.clock_width_s)
    host = t_s + session_start_s
    return ClockBounds("laser", _device_time(rig, t_s, effects), host - before, host - before + after)


def _device_time(rig: Rig, t_s: FloatArray, effects: Sequence[Effect]) -> FloatArray:
    for effect in effects:
        t_s = effect.laser_clock(t_s)
    return np.asarray(rig.laser_clock_offset_s + t_s * (1 + rig.laser_clock_ppm * 1e-6))


def simulate_run_with_truth(
    rig: Rig,
    motion: Motion,
    *,
    run_id: str,
    planned: PlannedRun | None,
    start_s: float,
    rng: np.random.Generator,
    effects: Sequence[Effect] = (),
    session_start_s: float = 0.0,
) -> tuple[Run, RunTruth]:
    """``simulate_run``, and the truth."""
    stream = _Streams(rng)
    k = Kinematics(motion, motion.t_s + (start_s - session_start_s), rig.screen.width_mm, rig.screen.height_mm)
    report = reporting(rig, k, effects, stream)
    events = touch_events(rig, k, report, effects, stream)
    true_edges = shadow_edges(rig, k, effects)
    edges = sensor_edges(rig, true_edges, effects, stream)
    laser_s = edges.t_s
    for effect in effects:
        laser_s = effect.laser_clock(laser_s)
    duration = float(motion.t_s[-1])
    checks = np.arange(k.session_s[0], k.session_s[-1], 1.0)
    run = Run(
        id=run_id,
        protocol=planned.kind if planned else "free",
        start_s=start_s,
        duration_s=duration,
        touch=TouchTrace(events.t_s + session_start_s, events.x_mm, events.y_mm, events.contact_id),
        laser=LaserTrace(laser_s + session_start_s, edges.light, _device_time(rig, edges.t_s, effects)),
        nominal_speed_mm_s=planned.nominal_speed_mm_s if planned else None,
        radius_mm=planned.radius_mm if planned else None,
        target=planned.target.parameters() if planned else {},
        display=_display(planned, start_s) if planned else None,
        sync=(clock_bounds(rig, checks, effects, stream("clock"), session_start_s),),
    )
    truth = RunTruth(
        true_edges.t_s + session_start_s,
        np.interp(true_edges.t_s, k.session_s, report.latency_s),
        np.interp(true_edges.t_s, k.session_s, k.speed_mm_s),
    )
    return run, truth


def _display(planned: PlannedRun, start_s: float) -> DisplayTrace:
    t = np.arange(int(planned.duration_s * FRAME_HZ) + 1) / FRAME_HZ
    return DisplayTrace(start_s + t, *planned.target.position_mm(t))


def simulate_run(
    rig: Rig,
    motion: Motion,
    *,
    run_id: str,
    planned: PlannedRun | None,
    start_s: float,
    rng: np.random.Generator,
    effects: Sequence[Effect] = (),
    session_start_s: float = 0.0,
) -> Run:
    """Recording of one motion.

    Args:
        planned: None for a free run.
        start_s: on the host clock; effects count time from ``session_start_s``.
        rng: gives one draw.
    """
    return simulate_run_with_truth(
        rig,
        motion,
        run_id=run_id,
        planned=planned,
        start_s=start_s,
        rng=rng,
        effects=effects,
        session_start_s=session_start_s,
    )[0]


def simulate_session_with_truth(
    screen_or_rig: str | Path | Rig,
    protocol: Protocol | str | Path,
    *,
    effects: Sequence[Effect] = (),
    seed: int = 0,
    human: Human | None = None,
    session_start_s: float = 0.0,
) -> tuple[Session, SimulationTruth]:
    """``simulate_session``, and the truth of every run."""
    rig = screen_or_rig if isinstance(screen_or_rig, Rig) else rig_for_screen(screen_or_rig)
    plan = protocol if isinstance(protocol, Protocol) else load_protocol(protocol)
    stream = _Streams(np.random.default_rng(seed))
    rests = stream("rests")
    clocks: list[ClockBounds] = []
    taps: list[Taps] = []
    runs: list[Run] = []
    truths: dict[str, RunTruth] = {}
    now = session_start_s

    def check_clocks(name: str) -> None:
        nonlocal now
        if plan.clock_check:
            t = now - session_start_s + np.arange(0.0, plan.clock_check.duration_s, plan.clock_check.interval_s)
            clocks.append(clock_bounds(rig, t, effects, stream(f"{name} clocks"), session_start_s))
            now += plan.clock_check.duration_s + plan.rest_s

    def tap(name: str) -> None:
        nonlocal now
        if plan.taps and plan.taps.when in (name, "both"):
            count, interval_s, rng = plan.taps.count, plan.taps.interval_s, stream(f"{name} taps")
            common = {"interval_s": interval_s, "session_start_s": session_start_s}
            taps.append(simulate_taps(rig, count, start_s=now, rng=rng, effects=effects, **common))
            now += count * interval_s + plan.rest_s

    check_clocks("start")
    tap("start")
    for planned in expand(plan, rig.screen, seed, beam=rig.beam):
        motion = follow(planned.target, human or Human(), stream(f"{planned.id} hand"))
        run, truths[planned.id] = simulate_run_with_truth(
            rig,
            motion,
            run_id=planned.id,
            planned=planned,
            start_s=round(now, 6),
            rng=stream(planned.id),
            effects=effects,
            session_start_s=session_start_s,
        )
        runs.append(replace(run, seed=seed))
        now += planned.duration_s + plan.rest_s * rests.uniform(0.8, 1.6)
    tap("end")
    check_clocks("end")
    session = _session(rig, plan, runs, taps, clocks)
    return replace(session, seed=seed), SimulationTruth(rig.law, tuple(effects), truths)


def _session(rig: Rig, plan: Protocol, runs: list[Run], taps: list[Taps], clocks: list[ClockBounds]) -> Session:
    return Session(
        name=f"{plan.name} on {rig.screen.name}, simulated",
        screen=rig.screen,
        stylus=rig.stylus,
        runs=tuple(runs),
        taps=concatenate(taps) if taps else None,
        beam=rig.beam,
        clocks=(concatenate(clocks),) if clocks else (),
        protocol_toml=plan.source,
        devices={"touch": "sim:", "laser": "sim:"} | ({"walt": "sim:"} if taps else {}),
    )


def simulate_session(
    screen_or_rig: str | Path | Rig,
    protocol: Protocol | str | Path,
    *,
    effects: Sequence[Effect] = (),
    seed: int = 0,
    human: Human | None = None,
    session_start_s: float = 0.0,
) -> Session:
    """Simulated session, bitwise reproducible.

    Args:
        screen_or_rig: screen preset, TOML file or rig.
        protocol: protocol, preset or TOML file.
        session_start_s: on the host clock.

    Raises DataError for an unknown preset, a malformed file or a target beyond the screen.
    """
    return simulate_session_with_truth(
        screen_or_rig, protocol, effects=effects, seed=seed, human=human, session_start_s=session_start_s
    )[0]
