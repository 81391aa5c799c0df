"""Simulated runs with a known latency, for benchmarks and for tests of the estimators."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from draglag.instruments.beam import sides
from draglag.latency.bound import HandSpectrum, TouchNoise, latency_bound_s
from draglag.protocol.runs import PlannedRun
from draglag.protocol.targets import Circle
from draglag.recording import Run
from draglag.simulation import Human, LatencyLaw, Rig, RunTruth, follow, rig_for_screen, simulate_run_with_truth

# Speed → (radius mm, revolutions): 30 to 60 edges each, as the reference figures have.
CONDITIONS = {50.0: (25.0, 12), 250.0: (50.0, 12), 1000.0: (100.0, 13)}


def circle_run(
    speed_mm_s: float,
    seed: int,
    rig: Rig | None = None,
    human: Human | None = None,
    radius_mm: float | None = None,
    revolutions: float | None = None,
    travel_per_diameter: float = 1.0,
    offset_mm: float = 0.0,
    turn: int = 1,
) -> tuple[Run, RunTruth, Circle, Rig]:
    """One run of a circle about the beam, and what really happened."""
    rig = rig or rig_for_screen("screen-1")
    known = CONDITIONS.get(speed_mm_s, (50.0, 12))
    radius_mm = radius_mm or known[0]
    duration_s = (revolutions or known[1]) * 2 * math.pi * radius_mm / speed_mm_s + 0.6
    travel_mm = travel_per_diameter * 2 * radius_mm
    x_mm = (rig.screen.width_mm - travel_mm) / 2
    y_mm = rig.beam.slope * rig.screen.width_mm / 2 + rig.beam.intercept_mm + offset_mm
    target = Circle(x_mm, y_mm, radius_mm, speed_mm_s, duration_s, travel_mm / duration_s, -math.pi / 2, turn)
    planned = PlannedRun("run-01", target, speed_mm_s, radius_mm)
    rng = np.random.default_rng([seed, round(speed_mm_s)])
    motion = follow(target, human or Human(), rng)
    run, truth = simulate_run_with_truth(rig, motion, run_id="run-01", planned=planned, start_s=3.0, rng=rng)
    return run, truth, target, rig


def constant_law(latency_s: float) -> LatencyLaw:
    return LatencyLaw(0.0, 0.0, 0.0, 0.0, 1e3 * latency_s)


def rig_with_latency(latency_s: float, **changes: object) -> Rig:
    rig = replace(rig_for_screen("screen-1"), law=constant_law(latency_s), run_latency_sd_s=0.0, contact_loss_per_s=0.0)
    return replace(rig, **changes)  # type: ignore[arg-type]


def noise_of(rig: Rig) -> TouchNoise:
    return TouchNoise(rig.noise_mm, rig.noise_slow_share, rig.noise_slow_s, rig.resolution_mm)


def spectrum_of(human: Human) -> HandSpectrum:
    return HandSpectrum(human.wander_mm, human.wander_hz, human.timing_sd_s, 0.4, human.gain_sd, human.tremor_mm)


def bound_of(run: Run, truth: RunTruth, target: Circle, rig: Rig, human: Human | None = None) -> float:
    """The bound for one simulated run, s; edges and speeds as intended, at their true times."""
    human = human or Human()
    t_s = run.touch.t_s - run.start_s - truth.mean_latency_s
    _, y = target.position_mm(t_s - human.lag_s)
    _, v = target.velocity_mm_s(t_s - human.lag_s)
    edge_s = truth.edge_s - run.start_s
    x_e, _ = target.position_mm(edge_s - human.lag_s)
    _, v_e = target.velocity_mm_s(edge_s - human.lag_s)
    beam_y = rig.beam.slope * x_e + rig.beam.intercept_mm
    # By kind and direction: a fast hand is further from its target than the stylus is wide. The first edge is dark.
    side = sides(np.arange(edge_s.size) % 2 == 0, v_e)
    seen = (edge_s > t_s[0] + 0.1) & (edge_s < t_s[-1] - 0.1)
    return latency_bound_s(
        edge_s[seen], x_e[seen], v_e[seen], side[seen], t_s, v, y - target.centre_y_mm, noise_of(rig),
        spectrum_of(human), float(np.mean(beam_y) - target.centre_y_mm),
    )  # fmt: skip
