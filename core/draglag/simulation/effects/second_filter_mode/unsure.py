"""Edges at which it is unsure which filter is used."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtr

from draglag.recording import FloatArray
from draglag.simulation.effects.second_filter_mode.setting import By, Setting

if TYPE_CHECKING:
    from draglag.gap.traces.edges import Placed

NEAR_SWITCH_S = 0.15
NEAR_SKIP_S = 0.01  # with the lateness undone in the trace
MOSTLY = 0.5
EITHER = 0.5  # probability of a state of which nothing is known. Derived
SURE = 1e-3  # probability of another state that is none: of a session's thousand edges not one. Derived


def state_variance(placed: Placed, setting: Setting, size_s: float) -> FloatArray:
    """Mean square (m,) by which an edge's state, 0 or 1, may be wrong.

    The stylus may be on the other side of the threshold; next to a switch its position averages both states.
    """
    if setting.by is By.SPEED:
        return _other_side(placed, setting.above, size_s)
    return _near_times(placed, setting) / 3


def _other_side(placed: Placed, above_mm_s: float, size_s: float) -> FloatArray:
    """Probability (m,) that the stylus is on the other side of a threshold; near a switch a half."""
    from draglag.gap.constants import USUAL_SPEED_ERROR, USUAL_TREMOR_MM_S

    sd_mm_s = np.hypot(USUAL_SPEED_ERROR * placed.speed_mm_s, USUAL_TREMOR_MM_S)
    apart_mm_s = np.abs(placed.speed_mm_s - above_mm_s) - NEAR_SWITCH_S * np.abs(placed.accel_apart_mm_s2)
    other = ndtr(-apart_mm_s / sd_mm_s)
    # A switch moves the position, which reads as speed: in a run without one no speed is read wrong.
    count = np.maximum(np.bincount(placed.run), 1)
    above = np.bincount(placed.run, np.where(placed.speed_mm_s > above_mm_s, 1 - other, other))
    switches = np.minimum(above, count - above) >= 1
    misread_mm_s = switches[placed.run] * placed.speed_mm_s * abs(size_s) / placed.speed_half_s
    other = np.minimum(ndtr((misread_mm_s - apart_mm_s) / sd_mm_s), EITHER)
    # In a run that is about the threshold all along, the other edges are those whose speed was read wrong.
    about = np.bincount(placed.run, other) >= MOSTLY * EITHER * count
    return np.asarray(np.where(about[placed.run], EITHER, np.where(other < SURE, 0.0, other)))


def _near_times(placed: Placed, setting: Setting) -> FloatArray:
    """Probability (m,) that an edge lies so near a switch that its position averages both levels."""
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
