"""Beam, sensor and the laser's clock."""

import numpy as np

from .digitiser import Panel
from .motion import Motion
from .real.beam import crossings
from .rig import Rig, RunPlan, stream


def edges(rig: Rig, panel: Panel, run: RunPlan, motion: Motion, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Edges of one run, each (k,): stamp in the file s, light after it (0 or 1); true host time of each crossing s."""
    e, v = panel.effects, panel.variants
    off, reach = _off_axis(rig, panel, motion)
    if rig.sensor is None:
        crossed, light, seen = _sharp(rig, run, motion, np.abs(off) - reach)
    else:
        rng = stream(seed, f"passes {run.id}")
        span = (run.start_s, run.start_s + run.duration_s)
        seen, light, crossed = crossings(rng, rig.sensor, motion.t_s, off, reach, span, rig.missed_share)
        light = light.astype(float)
    seen = seen + e.get("laser_hysteresis", 0.0) * light
    if "laser_bounce" in e:
        seen, light = _bounce(
            seen, light, e["laser_bounce"], v["laser_bounce"]["share"], stream(seed, f"bounce {run.id}")
        )
    stamp = seen * (1 + 1e-6 * e.get("clock_drift", 0.0)) + e.get("clock_offset", 0.0)
    return stamp, light, crossed


def _off_axis(rig: Rig, panel: Panel, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Signed distance (n,) of the stylus from the beam's axis, and its half width (n,) across it."""
    e, v = panel.effects, panel.variants
    across = motion.x_mm / rig.screen[1] - 0.5
    height = rig.beam_intercept_mm + rig.beam_slope * motion.x_mm
    bow = rig.beam_bow_mm + e.get("beam_bow", 0.0)
    if bow:  # y, which grows downwards, in the middle over the line through its places at the screen's sides
        height = height + bow * (1 - (2 * across) ** 2)
    if "beam_sway" in e:
        w = v["beam_sway"]
        height = height + e["beam_sway"] * np.sin(2 * np.pi * motion.t_s / w["period_s"] + w["phase"])
    disc = rig.diameter_mm if rig.disc_mm is None else rig.disc_mm
    reach = np.full_like(across, 0.5 * (disc + e.get("beam_width", 0.0)))
    reach = reach + 0.5 * e.get("beam_wedge", 0.0) * across
    return (motion.y_mm - height) / np.hypot(1, rig.beam_slope), reach


def _sharp(rig: Rig, run: RunPlan, motion: Motion, clear: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """True times (k,) at which the stylus' rim crosses a beam without width, light after, times the sensor has."""
    during = (motion.t_s >= run.start_s) & (motion.t_s < run.start_s + run.duration_s)
    at = np.flatnonzero((clear[1:] > 0) != (clear[:-1] > 0))
    at = at[during[at]]
    step = motion.t_s[1] - motion.t_s[0]
    crossed = motion.t_s[at] + step * clear[at] / (clear[at] - clear[at + 1])
    return crossed, (clear[at + 1] > 0).astype(float), crossed + rig.sensor_s


def _bounce(
    seen: np.ndarray, light: np.ndarray, lasts_s: float, share: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Comparator chatter: after the first transition the level falls back and returns, once to three times."""
    times, levels = [seen], [light]
    for when, level in zip(seen, light, strict=True):
        if rng.random() < share:
            n = 2 * int(rng.integers(1, 4))
            times.append(when + np.sort(rng.uniform(0.02, 1.0, n)) * lasts_s)
            levels.append(np.where(np.arange(n) % 2 == 0, 1 - level, level))
    t, s = np.concatenate(times), np.concatenate(levels)
    order = np.argsort(t, kind="stable")
    t, s = t[order], s[order]
    if len(s) == 0:
        return t, s
    changed = np.concatenate([[True], s[1:] != s[:-1]])
    return t[changed], s[changed]
