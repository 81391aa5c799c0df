"""Taps timed by a WALT."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from draglag.recording import Taps
from draglag.simulation.effects.base import Effect
from draglag.simulation.rig import Rig


def simulate_taps(
    rig: Rig,
    count: int,
    *,
    start_s: float,
    rng: np.random.Generator,
    interval_s: float = 0.8,
    effects: Sequence[Effect] = (),
    session_start_s: float = 0.0,
) -> Taps:
    """``count`` taps, each a touch and a release, on the host clock."""
    down = start_s + (np.arange(count) + rng.uniform(0.0, 0.3, count)) * interval_s
    up = down + rng.uniform(0.08, 0.16, count)
    physical = np.stack([down, up], axis=1).ravel()
    kind = np.tile(np.array([1, 0], np.int64), count)
    latency = np.where(kind == 1, rig.tap_touch_s, rig.tap_release_s)
    latency = latency + rig.tap_spread_s * rng.standard_normal(len(physical))
    for effect in effects:
        latency = effect.tap_latency(latency, physical - session_start_s)
    return Taps(physical, np.round(physical + np.maximum(latency, 0.0), 6), kind)
