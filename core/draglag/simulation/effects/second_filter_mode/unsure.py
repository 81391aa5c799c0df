"""Edges at which it is unsure which filter is used."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.second_filter_mode.setting import By, Setting

if TYPE_CHECKING:
    from draglag.gap.traces.edges import Placed

NEAR_SWITCH_S = 0.15
NEAR_SKIP_S = 0.01  # with the lateness undone in the trace
MOSTLY = 0.5
UNSURE_MM_S = 12.0  # of a speed at an edge: a tremor of 0.2 mm at 9 Hz is no longer seen in it


def near_switch(placed: Placed, setting: Setting, size_s: float) -> FloatArray:
    """Probability (m,) that an edge lies so near a switch that its state is unsure, or its position averages both."""
    if setting.by is By.SPEED:
        unsure_mm_s = NEAR_SWITCH_S * np.abs(placed.accel_apart_mm_s2) + UNSURE_MM_S
        unsure_mm_s += placed.speed_mm_s * abs(size_s) / placed.speed_half_s
        near = np.abs(placed.speed_mm_s - setting.above) < unsure_mm_s
        # In a run that is about the threshold all along, the other edges are those whose speed was read wrong.
        share = np.bincount(placed.run, near) / np.maximum(np.bincount(placed.run), 1)
        return np.asarray((near | (share >= MOSTLY)[placed.run]).astype(float))
    times = np.array(setting.times_s)
    if times.size == 0:
        return np.zeros(len(placed))
    at_s = placed.since_start_s + (placed.latency_s if setting.shown else 0.0)
    first_s, last_s = (times, times) if setting.shown else _between_edges(placed, times)
    reach_s = NEAR_SKIP_S if setting.shown else NEAR_SWITCH_S
    after = np.clip(np.searchsorted(times, at_s), 1, times.size - 1)
    out = np.zeros(len(placed))
    for k in (after - 1, after):
        inside_s = np.minimum(at_s + reach_s, last_s[k]) - np.maximum(at_s - reach_s, first_s[k])
        exact = last_s[k] <= first_s[k]
        width_s = np.where(exact, 1.0, last_s[k] - first_s[k])
        share = np.where(exact, inside_s >= 0, np.clip(inside_s / width_s, 0, 1))
        out = np.maximum(out, share)
    return out


def _between_edges(placed: Placed, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Last edge before and first edge after each time: no more is known of it. ∞, −∞ between two runs."""
    order = np.argsort(placed.since_start_s)
    edges_s, run = placed.since_start_s[order], placed.run[order]
    after = np.clip(np.searchsorted(edges_s, times), 1, edges_s.size - 1)
    one_run = run[after - 1] == run[after]
    return np.where(one_run, edges_s[after - 1], np.inf), np.where(one_run, edges_s[after], -np.inf)
