"""Touch events from the stylus' motion: stamped τ, the position at t with t + L(v(t)) = τ."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from draglag.path.recursion import recursion
from draglag.recording import FloatArray, IntArray
from draglag.simulation.effects.base import Effect, TouchEvents
from draglag.simulation.kinematics import Kinematics
from draglag.simulation.rig import Rig

Stream = Callable[[str], np.random.Generator]
"""A random generator for each named part: adding one does not disturb the others."""


@dataclass(frozen=True)
class Reporting:
    """When and where each point of the motion is reported, (n,)."""

    latency_s: FloatArray
    x_mm: FloatArray
    y_mm: FloatArray


def reporting(rig: Rig, k: Kinematics, effects: Sequence[Effect], stream: Stream) -> Reporting:
    """Reporting before scanning and noise."""
    speed = k.speed_mm_s
    for effect in effects:
        speed = effect.law_speed(speed, k)
    latency = rig.law.latency_s(speed)
    for effect in effects:
        latency = effect.latency(latency, k, stream(effect.id))
    own = stream("run")
    latency = latency + rig.run_latency_sd_s * own.standard_normal()
    x, y = k.motion.x_mm, k.motion.y_mm
    for effect in effects:
        x, y = effect.position(x, y, k)
    off_x, off_y = rig.run_offset_sd_mm * own.standard_normal(2)
    return Reporting(latency, x + off_x, y + off_y)


def arrival(t_s: FloatArray, latency_s: FloatArray) -> FloatArray:
    """Increasing stamps t + L, (n,); where L falls faster than time passes, positions arrive together."""
    tau = np.minimum.accumulate((t_s + latency_s)[::-1])[::-1]
    return np.asarray(tau + 1e-12 * np.arange(len(tau)))  # strictly increasing, so that it can be inverted


def scan(rig: Rig, k: Kinematics, report: Reporting, rng: np.random.Generator) -> FloatArray:
    """Jittered session times of scans, in whole µs."""
    period = 1 / rig.touch_rate_hz
    first, last = k.session_s[0], k.session_s[-1]
    n = int((last - first) / period) + 1
    stamps = first + (np.arange(n) + rng.uniform()) * period
    jitter = np.clip(rig.scan_jitter_s * rng.standard_normal(n), -0.4 * period, 0.4 * period)
    stamps = np.round(stamps + jitter, 6)
    return np.asarray(stamps[stamps <= last])


def _noise(rig: Rig, n: int, rng: np.random.Generator) -> FloatArray:
    white, slow = rng.standard_normal((2, n))
    keep = np.exp(-1 / (rig.touch_rate_hz * rig.noise_slow_s))
    slow[1:] *= np.sqrt(1 - keep**2)
    slow = recursion(np.full(n, keep), slow)
    share = rig.noise_slow_share
    return np.asarray(rig.noise_mm * (np.sqrt(1 - share) * white + np.sqrt(share) * slow))


def _lost(rig: Rig, t_s: FloatArray, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Begins and ends of contact losses, on the stylus' time."""
    n = rng.poisson(rig.contact_loss_per_s * (t_s[-1] - t_s[0]))
    start = np.sort(rng.uniform(t_s[0], t_s[-1], n))
    return start, start + rng.exponential(rig.contact_loss_s, n) + 0.02


def touch_events(rig: Rig, k: Kinematics, report: Reporting, effects: Sequence[Effect], stream: Stream) -> TouchEvents:
    """Touch events of a run in session time."""
    stamps = scan(rig, k, report, stream("scan"))
    tau = arrival(k.session_s, report.latency_s)
    grid = np.arange(len(tau), dtype=float)
    at = np.interp(stamps, tau, grid, left=-1.0, right=-1.0)  # fractional index into the motion
    seen = at >= 0
    stamps, at = stamps[seen], at[seen]
    touching = k.motion.in_contact[np.rint(at).astype(int)]
    contact = _contact_ids(k)[np.rint(at).astype(int)]
    stylus_s = np.interp(at, grid, k.session_s)
    starts, ends = _lost(rig, k.session_s, stream("loss"))
    begun = np.searchsorted(starts, stylus_s, side="right")
    latest_end = np.concatenate(([-np.inf], np.maximum.accumulate(ends)))
    touching &= stylus_s >= latest_end[begun]
    contact = contact + begun
    x, y = np.interp(at, grid, report.x_mm), np.interp(at, grid, report.y_mm)
    noise = stream("noise")
    x, y = x + _noise(rig, len(x), noise), y + _noise(rig, len(y), noise)
    if rig.resolution_mm:
        x, y = (rig.resolution_mm * np.round(p / rig.resolution_mm) for p in (x, y))
    events = TouchEvents(stamps[touching], x[touching], y[touching], contact[touching])
    for effect in sorted(effects, key=lambda e: e.order):
        events = effect.events(events, stream(effect.id + " events"))
    return events


def _contact_ids(k: Kinematics) -> IntArray:
    begins = np.diff(k.motion.in_contact.astype(np.int64), prepend=0) > 0
    return np.cumsum(begins)
