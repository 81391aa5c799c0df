"""The touch panel: scans at its own rate, and shows at τ where the stylus was at t, τ = t + latency(t)."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.signal import lfilter

from .filters import run_filters
from .motion import Motion
from .rig import Rig, RunPlan, stream

LEAST_DELAY_S = 0.001  # of any panel


@dataclass(frozen=True)
class Panel:
    """Where each hidden thing of this session sits; drawn once a session. Effect sizes are in `effects`."""

    effects: dict[str, float]
    variants: dict[str, object]


def latency(rig: Rig, panel: Panel, run: RunPlan, motion: Motion, own_s: float, seed: int) -> np.ndarray:
    """Latency (n,) s that the report of the stylus at each instant of `motion` has."""
    e, v = panel.effects, panel.variants
    out = rig.law(_law_speed(rig, panel, motion)) + own_s
    out += 0.5 * e.get("direction_asymmetry", 0.0) * np.sign(motion.vy_mm_s)
    out += e.get("thermal_drift", 0.0) * motion.t_s / 3600.0
    out += e.get("scan_skew", 0.0) * motion.x_mm / rig.screen[1]
    out += e.get("acceleration_lag", 0.0) * motion.along_mm_s2
    for name, shape in SHAPES.items():
        if name in e:
            out += e[name] * shape(v[name], run, motion, seed)
    if "smoothing_shrink" in e and v["smoothing_shrink"]["delay_in_law"]:
        out -= e["smoothing_shrink"]
    # A panel never goes back in time and skips nothing: where the latency would fall faster than time passes (a sudden
    # start), it catches up, showing the past at most 1/catch_up as fast as it happened.
    steady = rig.catch_up * motion.t_s
    return np.maximum.accumulate(motion.t_s + np.maximum(out, LEAST_DELAY_S) - steady) + steady - motion.t_s


def _law_speed(rig: Rig, panel: Panel, motion: Motion) -> np.ndarray:
    """The speed (n,) mm/s that the law follows."""
    e, v = panel.effects, panel.variants
    speed = motion.speed_mm_s
    if "lagging_law" in e:
        if v["lagging_law"]["present"]:  # the filter picks its strength by what moves now, not by what it is showing
            ahead = rig.law(speed)
            for _ in range(3):
                ahead = rig.law(np.interp(motion.t_s + ahead, motion.t_s, speed))
            speed = np.interp(motion.t_s + ahead, motion.t_s, speed)
        else:
            shift = round(e["lagging_law"] * motion.step_hz)
            speed = np.concatenate([np.full(shift, speed[0]), speed[: len(speed) - shift]])
    return np.maximum(speed, e["low_speed_plateau"]) if "low_speed_plateau" in e else speed


def warmed(size_s: float, where: dict, t_s: np.ndarray) -> np.ndarray:
    """Latency (n,) that a screen has yet to lose; it is switched on at the start of the session."""
    return np.asarray(size_s * _still_cold(where, t_s))


def _still_cold(where: dict, t_s: np.ndarray) -> np.ndarray:
    return np.asarray(np.exp(-np.maximum(t_s, 0.0) / where["time_constant_s"]))


def _mode_active(where: dict, motion: Motion, seed: int, run_id: str) -> np.ndarray:
    if where["kind"] == "speed":
        return motion.speed_mm_s > where["above_mm_s"]
    if where["kind"] == "acceleration":
        return np.abs(motion.along_mm_s2) > where["above_mm_s2"]
    rng = stream(seed, f"mode {run_id}")
    switches = np.cumsum(rng.exponential(where["dwell_s"], 60)) + motion.t_s[0]
    return (np.searchsorted(switches, motion.t_s) + rng.integers(2)) % 2 == 1


def _bump(where: dict, motion: Motion) -> np.ndarray:
    return np.asarray(np.exp(-0.5 * ((motion.speed_mm_s - where["speed_mm_s"]) / where["width_mm_s"]) ** 2))


# Effect → the share (n,) of its size that is there at each instant, by where it sits, the run, its motion and the seed.
SHAPES: dict[str, Callable[[Any, RunPlan, Motion, int], np.ndarray]] = {
    "warm_up": lambda where, run, motion, seed: _still_cold(where, motion.t_s),
    "second_filter_mode": lambda where, run, motion, seed: _mode_active(where, motion, seed, run.id),
    "split_panel": lambda where, run, motion, seed: motion.x_mm > where["at_x_mm"],
    "settling": lambda where, run, motion, seed: np.exp(-np.maximum(motion.t_s - run.start_s, 0) / where["decay_s"]),
    "speed_resonance": lambda where, run, motion, seed: _bump(where, motion),
}


def shown_position(rig: Rig, panel: Panel, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Where the panel believes the stylus is at each instant, before latency and noise; two (n,) in mm."""
    e, v = panel.effects, panel.variants
    width, height = rig.screen[1], rig.screen[2]
    x, y = motion.x_mm, motion.y_mm
    if "contact_trail" in e:
        slow = np.hypot(motion.speed_mm_s, 3.0)
        x, y = x - e["contact_trail"] * motion.vx_mm_s / slow, y - e["contact_trail"] * motion.vy_mm_s / slow
    if "smoothing_shrink" in e:
        keep = np.exp(-1 / (motion.step_hz * e["smoothing_shrink"]))
        x, y = (q[0] + lfilter([1 - keep], [1, -keep], q - q[0]) for q in (x, y))
    dx, dy = np.zeros_like(x), np.zeros_like(y)
    if "spatial_warp" in e:
        w = v["spatial_warp"]
        across, down = 2 * np.pi * x / width, 2 * np.pi * y / height
        dy += e["spatial_warp"] * np.sin(w["cycles"] * across + w["phase"]) * np.cos(0.3 * down * w["y_cycles"])
        dx += 0.6 * e["spatial_warp"] * np.sin(w["y_cycles"] * down + w["y_phase"])
    if "pitch_ripple" in e:
        w = v["pitch_ripple"]
        k, p = 2 * np.pi / w["pitch_mm"], w["phases"]
        # Rows and columns cross in a diamond lattice, so the error of either axis repeats along both.
        dy += e["pitch_ripple"] * (np.sin(k * x + p[0]) + w["row_share"] * np.sin(k * y + p[1]))
        dx += e["pitch_ripple"] * (np.sin(k * x + p[2]) + w["row_share"] * np.sin(k * y + p[3]))
    if "split_offset" in e:
        dy += e["split_offset"] * (x > v["split_offset"]["at_x_mm"])
    grow = e.get("scale_error", 0.0)
    return x + dx + grow * (x - width / 2), y + dy + grow * (y - height / 2)


def scan(rig: Rig, panel: Panel, run: RunPlan, motion: Motion, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Reports of one run: stamps s, x mm, y mm, each (m,), and the latency (n,) behind them, but for the filters'."""
    rng = stream(seed, f"digitiser {run.id}")
    own_s = rng.normal() * rig.run_latency_sd_s
    own_mm = rng.normal() * rig.run_offset_sd_mm
    behind = latency(rig, panel, run, motion, own_s, seed)
    x, y = shown_position(rig, panel, motion)
    first = run.start_s + rng.uniform(0.3, 0.4)
    period = 1 / (rig.rate_hz * rig.scans_per_report)
    tau = np.arange(first, run.start_s + run.duration_s, period)
    tau = tau + rng.normal(0, 1, len(tau)).clip(-3, 3) * rig.scan_jitter_s
    shown_at = motion.t_s + behind
    seen = np.searchsorted(shown_at, tau, side="right").clip(1, len(shown_at) - 1)
    gap = shown_at[seen] - shown_at[seen - 1]
    share = np.where(gap > 0, (tau - shown_at[seen - 1]) / np.maximum(gap, 1e-12), 1.0).clip(0, 1)
    px = x[seen - 1] + share * (x[seen] - x[seen - 1])
    py = y[seen - 1] + share * (y[seen] - y[seen - 1])
    noise = [rig.noise_mm * _noise(rng, len(tau), rig.noise_correlation, rig.correlated_share) for _ in range(2)]
    px, py = px + noise[0], py + noise[1] + own_mm
    if rig.world == "realistic":  # the contact's centroid moves with the stylus' tilt, along either axis
        px = px + rng.normal() * rig.run_offset_sd_mm
    px, py = run_filters(panel.effects, panel.variants, tau, (px, py))
    kept = slice(None, None, rig.scans_per_report)
    return tau[kept], rounded(px[kept], rig.step_mm), rounded(py[kept], rig.step_mm), behind


def rounded(q: np.ndarray, step: float) -> np.ndarray:
    """q (n,) in whole steps; a step of 0 leaves it."""
    return np.asarray(np.round(q / step) * step) if step > 0 else q


def _noise(rng: np.random.Generator, n: int, correlation: float, share: float) -> np.ndarray:
    """Unit variance, of which `share` follows a first-order recursion."""
    white, slow = rng.normal(size=n), rng.normal(size=n + 100)
    slow = lfilter([np.sqrt(1 - correlation**2)], [1, -correlation], slow)[100:]
    return np.sqrt(1 - share) * white + np.sqrt(share) * slow
