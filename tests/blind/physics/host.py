"""What happens to reports between the panel and the file."""

import numpy as np

from .digitiser import Panel, warmed
from .rig import Rig, RunPlan, stream

POLL_JITTER_S = 4e-5  # from the host's poll to its stamp

Reports = tuple[np.ndarray, np.ndarray, np.ndarray]


def deliver(rig: Rig, panel: Panel, run: RunPlan, reports: Reports, seed: int) -> Reports:
    """Stamps, x and y as the file has them."""
    e, v = panel.effects, panel.variants
    t, x, y = reports
    if rig.loss_rate_hz > 0:
        keep = ~_holes(t, rig.loss_rate_hz, 0.04, 0.15, stream(seed, f"loss {run.id}"))
        t, x, y = t[keep], x[keep], y[keep]
    if "loss_of_contact" in e:
        w = v["loss_of_contact"]
        lost = _holes(t, e["loss_of_contact"], w["shortest_s"], w["longest_s"], stream(seed, f"fill {run.id}"))
        lost[[0, -1]] = False
        x = np.where(lost, np.interp(t, t[~lost], x[~lost]), x)
        y = np.where(lost, np.interp(t, t[~lost], y[~lost]), y)
    if "frame_drop" in e:
        rng = stream(seed, f"drop {run.id}")
        burst = v["frame_drop"]["mean_burst"]
        begins = rng.random(len(t)) < _begins(e["frame_drop"], burst)
        keep = np.ones(len(t), bool)
        for k in np.flatnonzero(begins):
            keep[k : k + rng.geometric(1 / burst)] = False
        t, x, y = t[keep], x[keep], y[keep]
    if "stalls" in e:
        t = _stall(t, e["stalls"], v["stalls"]["every_s"], stream(seed, f"stall {run.id}"))
    if "frame_batching" in e:
        size = round(e["frame_batching"])
        group = (np.arange(len(t)) + stream(seed, f"batch {run.id}").integers(size)) // size
        last = np.searchsorted(group, group, side="right") - 1
        first = np.searchsorted(group, group, side="left")
        t = t[last] + (np.arange(len(t)) - first) * v["frame_batching"]["spacing_s"]
    if "poll_grid" in e:
        rng = stream(seed, f"poll {run.id}")
        slot = _polled(t, e["poll_grid"], v["poll_grid"]["phase"])
        newest = np.append(slot[1:] > slot[:-1], True)  # one report a poll: an older one is written over
        t, x, y = slot[newest] + np.abs(rng.normal(0, POLL_JITTER_S, newest.sum())), x[newest], y[newest]
    if "timestamp_quantisation" in e:
        t = np.floor(t / e["timestamp_quantisation"] + 1e-9) * e["timestamp_quantisation"]
    if "sample_hold" in e:
        rng = stream(seed, f"ticks {run.id}")
        ticks = np.arange(t[0] + rng.uniform(0, 1) / e["sample_hold"], t[-1], 1 / e["sample_hold"])
        ticks = ticks + np.abs(rng.normal(0, 2e-5, len(ticks)))
        held = np.searchsorted(t, ticks, side="right") - 1
        good = held >= 0
        t, x, y = ticks[good], x[held[good]], y[held[good]]
    return t, x, y


def _polled(t: np.ndarray, every_s: float, phase: float) -> np.ndarray:
    """When the host asks next, for each report (n,)."""
    return np.asarray((np.ceil(t / every_s - phase) + phase) * every_s)


def _begins(share: float, mean_burst: float) -> float:
    """How often bursts of frames begin that lose this share of them, where some overlap."""
    going_on = (1 - 1 / mean_burst) ** np.arange(60)
    low, high = 0.0, share
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if 1 - np.prod(1 - middle * going_on) < share else (low, middle)
    return high


def _holes(t: np.ndarray, rate_hz: float, shortest_s: float, longest_s: float, rng: np.random.Generator) -> np.ndarray:
    lost = np.zeros(len(t), bool)
    when = t[0] + rng.exponential(1 / rate_hz)
    while when < t[-1]:
        lasts = rng.uniform(shortest_s, longest_s)
        lost |= (t >= when) & (t < when + lasts)
        when += lasts + rng.exponential(1 / rate_hz)
    return lost


def _stall(t: np.ndarray, lasts_s: float, every_s: float, rng: np.random.Generator) -> np.ndarray:
    out = t.copy()
    when = t[0] + rng.uniform(0, every_s)
    while when < t[-1]:
        held = np.flatnonzero((t >= when) & (t < when + lasts_s))
        out[held] = when + lasts_s + np.arange(len(held)) * 3e-5
        when += every_s * rng.uniform(0.97, 1.03)
    return np.maximum.accumulate(out)


def taps(rig: Rig, panel: Panel, n: int, start_s: float, seed: int, name: str) -> np.ndarray:
    """Taps (2n, 3): physical s, registered s, down. On the host's clock throughout; at the middle of the screen."""
    e = panel.effects
    rng = stream(seed, f"taps {name}")
    down = start_s + np.cumsum(rng.uniform(0.6, 0.8, n))
    physical = np.stack([down, down + rng.uniform(0.18, 0.25, n)], axis=1).ravel()
    is_down = np.tile([1.0, 0.0], n)
    delay = rig.law.asymptote_s + rig.tap["release_s"] + rig.tap["touch_extra_s"] * is_down
    delay = delay + e.get("thermal_drift", 0.0) * physical / 3600.0 + 0.5 * e.get("scan_skew", 0.0)
    if "warm_up" in e:
        delay = delay + warmed(e["warm_up"], panel.variants["warm_up"], physical)
    delay = delay + rng.normal(0, 1, 2 * n) * rig.tap["sd_s"] * np.where(is_down > 0, 1.25, 1.0)
    registered = physical + np.maximum(delay, 0.004)
    if "poll_grid" in e:
        registered = _polled(registered, e["poll_grid"], panel.variants["poll_grid"]["phase"])
    if "timestamp_quantisation" in e:
        registered = np.floor(registered / e["timestamp_quantisation"]) * e["timestamp_quantisation"]
    if "sample_hold" in e:
        registered = np.ceil(registered * e["sample_hold"]) / e["sample_hold"]
    return np.column_stack([physical, registered, is_down])
