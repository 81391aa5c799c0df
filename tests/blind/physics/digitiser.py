"""The touch panel: scans at its own rate, and shows at τ where the stylus was at t, τ = t + latency(t)."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from .filters import FILTERS, draw_filter, run_filters
from .motion import Motion
from .rig import Rig, RunPlan, stream

LEAST_DELAY_S = 0.001  # of any panel


@dataclass(frozen=True)
class Panel:
    """Where each hidden thing of this session sits; drawn once a session. Effect sizes are in `effects`."""

    effects: dict[str, float]
    variants: dict[str, object]


def draw_variants(seed: int, effects: dict[str, float], rig: Rig) -> dict[str, object]:
    """The parts of effects that their one size leaves open."""
    width_mm = rig.screen[1]
    out: dict[str, object] = {}
    for name in effects:
        rng = stream(seed, f"variant {name}")
        if name in FILTERS:
            out[name] = draw_filter(name, rng)
        elif name == "warm_up":
            out[name] = {"time_constant_s": rng.uniform(400, 600)}
        elif name == "poll_grid":
            out[name] = {"phase": rng.uniform(0, 1)}
        elif name == "spatial_warp":
            out[name] = {
                "cycles": rng.uniform(0.7, 1.6),
                "phase": rng.uniform(0, 2 * np.pi),
                "y_cycles": rng.uniform(0.3, 0.8),
                "y_phase": rng.uniform(0, 2 * np.pi),
            }
        elif name == "pitch_ripple":
            out[name] = {
                "pitch_mm": rng.uniform(4, 7),
                "phases": rng.uniform(0, 2 * np.pi, 4).tolist(),
                "row_share": rng.uniform(0, 1),
            }
        elif name == "second_filter_mode":
            kind = str(rng.choice(["speed", "acceleration", "time"], p=[0.6, 0.2, 0.2]))
            out[name] = {
                "kind": kind,
                "above_mm_s": float(np.exp(rng.uniform(np.log(120), np.log(450)))),
                "above_mm_s2": rng.uniform(80, 250),
                "dwell_s": rng.uniform(4, 15),
            }
        elif name == "smoothing_shrink":
            # A panel that is quicker than its low-pass does not smooth with it: the delay comes on top.
            fits = effects[name] < rig.law.asymptote_s - LEAST_DELAY_S
            out[name] = {"delay_in_law": bool(rng.random() < 0.5) and fits}
        elif name == "lagging_law":
            out[name] = {"present": bool(rng.random() < 0.25)}
        elif name in ("split_panel", "split_offset"):
            out[name] = {"at_x_mm": width_mm * rng.uniform(0.3, 0.7)}
        elif name == "settling":
            out[name] = {"decay_s": rng.uniform(1.5, 5.0)}
        elif name == "speed_resonance":
            centre = float(np.exp(rng.uniform(np.log(110), np.log(450))))
            out[name] = {"speed_mm_s": centre, "width_mm_s": centre * rng.uniform(0.12, 0.22)}
        elif name == "stalls":
            out[name] = {"every_s": rng.uniform(1.5, 4.0)}
        elif name == "beam_sway":
            out[name] = {"period_s": rng.uniform(25, 120), "phase": rng.uniform(0, 2 * np.pi)}
        elif name == "loss_of_contact":
            out[name] = {"shortest_s": 0.05, "longest_s": rng.uniform(0.12, 0.25)}
        elif name == "frame_batching":
            out[name] = {"spacing_s": float(rng.choice([0.0, 2e-5, 1e-4]))}
        elif name == "laser_bounce":
            out[name] = {"share": rng.uniform(0.4, 1.0)}
        elif name == "frame_drop":
            out[name] = {"mean_burst": rng.uniform(1.0, 2.0)}
    return out


def latency(rig: Rig, panel: Panel, run: RunPlan, motion: Motion, own_s: float, seed: int) -> np.ndarray:
    """Latency (n,) s that the report of the stylus at each instant of `motion` has."""
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
    if "low_speed_plateau" in e:
        speed = np.maximum(speed, e["low_speed_plateau"])
    out = rig.law(speed) + own_s
    out += 0.5 * e.get("direction_asymmetry", 0.0) * np.sign(motion.vy_mm_s)
    out += e.get("thermal_drift", 0.0) * motion.t_s / 3600.0
    if "warm_up" in e:
        out += warmed(e["warm_up"], v["warm_up"], motion.t_s)
    out += e.get("scan_skew", 0.0) * motion.x_mm / rig.screen[1]
    out += e.get("acceleration_lag", 0.0) * motion.along_mm_s2
    if "second_filter_mode" in e:
        out += e["second_filter_mode"] * _mode_active(v["second_filter_mode"], motion, seed, run.id)
    if "split_panel" in e:
        out += e["split_panel"] * (motion.x_mm > v["split_panel"]["at_x_mm"])
    if "settling" in e:
        out += e["settling"] * np.exp(-np.maximum(motion.t_s - run.start_s, 0) / v["settling"]["decay_s"])
    if "speed_resonance" in e:
        where = v["speed_resonance"]
        out += e["speed_resonance"] * np.exp(
            -0.5 * ((motion.speed_mm_s - where["speed_mm_s"]) / where["width_mm_s"]) ** 2
        )
    if "smoothing_shrink" in e and v["smoothing_shrink"]["delay_in_law"]:
        out -= e["smoothing_shrink"]
    # A panel never goes back in time and skips nothing: where the latency would fall faster than time passes (a sudden
    # start), it catches up, showing the past at most 1/catch_up as fast as it happened.
    steady = rig.catch_up * motion.t_s
    return np.maximum.accumulate(motion.t_s + np.maximum(out, LEAST_DELAY_S) - steady) + steady - motion.t_s


def warmed(size_s: float, where: dict, t_s: np.ndarray) -> np.ndarray:
    """Latency (n,) that a screen has yet to lose; it is switched on at the start of the session."""
    return np.asarray(size_s * np.exp(-np.maximum(t_s, 0.0) / where["time_constant_s"]))


def _mode_active(where: dict, motion: Motion, seed: int, run_id: str) -> np.ndarray:
    if where["kind"] == "speed":
        return motion.speed_mm_s > where["above_mm_s"]
    if where["kind"] == "acceleration":
        return np.abs(motion.along_mm_s2) > where["above_mm_s2"]
    rng = stream(seed, f"mode {run_id}")
    switches = np.cumsum(rng.exponential(where["dwell_s"], 60)) + motion.t_s[0]
    return (np.searchsorted(switches, motion.t_s) + rng.integers(2)) % 2 == 1


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
