"""A run of the protocol as a real hand makes it."""

from dataclasses import replace

import numpy as np

from ..hand import multisine_mm, steps_mm
from ..motion import Motion, tracked
from ..rig import Rig, RunPlan, stream
from .hand import STEP_HZ, clock, drag, follow

MARGIN_MM = 12.0


def move(rig: Rig, run: RunPlan, seed: int) -> Motion:
    """The stylus through one run. Which way round the circle goes is the hand's own choice, not the plan's."""
    rng = stream(seed, f"hand {run.id}")
    width, height = rig.screen[1], rig.screen[2]
    middle = rig.beam_slope * width / 2 + rig.beam_intercept_mm + run.centre_off_beam_mm
    if run.protocol in ("circle", "chirp"):
        speed: float | np.ndarray = run.nominal_speed_mm_s or 0.0
        if run.protocol == "chirp":
            turns_hz = 0.05 + 0.95 * np.clip(clock(run.duration_s) / run.duration_s, 0, 1)
            speed = 2 * np.pi * run.radius_mm * turns_hz
        travel = max(width - 2 * (run.radius_mm + MARGIN_MM), 0.0)
        motion = drag(rng, speed, run.radius_mm, run.duration_s, (width / 2, middle), travel)
    else:
        since = clock(run.duration_s)
        x = width * (0.16 + 0.68 * np.clip(since / run.duration_s, 0, 1))
        y = multisine_mm(since, height) if run.protocol == "multisine" else steps_mm(since, height, rng)
        motion = follow(rng, since, x, middle + y)
    speed = _followed(rig, motion)
    return replace(motion, t_s=motion.t_s + run.start_s, speed_mm_s=speed, along_mm_s2=np.gradient(speed, 1 / STEP_HZ))


def _followed(rig: Rig, motion: Motion) -> np.ndarray:
    """What a digitiser's tracker takes for the speed: the mean of its window, or the size of a mean velocity."""
    if not rig.velocity_window_s:
        return tracked(motion.speed_mm_s, rig.speed_window_s, STEP_HZ)
    velocity = (tracked(part, rig.velocity_window_s, STEP_HZ) for part in (motion.vx_mm_s, motion.vy_mm_s))
    return np.asarray(np.hypot(*velocity))
