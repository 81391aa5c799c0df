"""The simulated measuring rig and its presets."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from draglag.errors import DataError
from draglag.messages import message
from draglag.protocol.presets import load_screen_file
from draglag.recording import Beam, Screen, Stylus
from draglag.simulation.law import LatencyLaw


@dataclass(frozen=True)
class Rig:
    """Screen, stylus, beam, digitiser, sensor, clocks and WALT.

    Attributes:
        noise_mm: standard deviation per axis; ``noise_slow_share`` of its variance is correlated over ``noise_slow_s``.
        run_latency_sd_s, run_offset_sd_mm: unexplained differences between runs.
        contact_loss_per_s, contact_loss_s: rate and mean duration.
        sensor_response_s: of either kind of edge.
        laser_clock_offset_s, laser_clock_ppm: against the host clock.
        clock_width_s: of a clock comparison's bounds.
        tap_touch_s, tap_release_s, tap_spread_s: medians and spread of latency.
    """

    screen: Screen
    stylus: Stylus
    law: LatencyLaw
    beam: Beam
    touch_rate_hz: float = 120.0
    scan_jitter_s: float = 1e-4
    noise_mm: float = 0.15
    noise_slow_share: float = 0.2
    noise_slow_s: float = 0.04
    resolution_mm: float = 0.02
    run_latency_sd_s: float = 3e-4
    run_offset_sd_mm: float = 0.02
    contact_loss_per_s: float = 0.01
    contact_loss_s: float = 0.05
    sensor_response_s: float = 55e-6
    laser_clock_offset_s: float = 12.5
    laser_clock_ppm: float = 4.0
    clock_width_s: float = 2e-4
    tap_touch_s: float = 0.030
    tap_release_s: float = 0.0285
    tap_spread_s: float = 0.0025

    def ideal(self) -> Rig:
        """Rig without touch errors, differences between runs and sensor delay."""
        return replace(
            self,
            scan_jitter_s=0.0,
            noise_mm=0.0,
            resolution_mm=0.0,
            run_latency_sd_s=0.0,
            run_offset_sd_mm=0.0,
            contact_loss_per_s=0.0,
            sensor_response_s=0.0,
        )


def rig_for_screen(name_or_path: str | Path) -> Rig:
    """Rig of a screen preset or TOML file, its beam tilted by 0.3° through the middle.

    Raises DataError for an unknown screen, or one without a latency law.
    """
    preset = load_screen_file(name_or_path)
    if preset.law is None:
        raise DataError(
            message("screen '{screen}' has no latency law", screen=preset.name), "add a [law] table with a1_ms … a7_ms"
        )
    screen = Screen(preset.name, **preset.screen.model_dump())
    slope = 0.005
    return Rig(
        screen=screen,
        stylus=Stylus(preset.stylus.diameter_mm, "simulated"),
        law=LatencyLaw(**preset.law.model_dump()),
        beam=Beam(slope, (screen.height_mm - slope * screen.width_mm) / 2),
        **preset.digitiser.model_dump(),
        tap_touch_s=preset.taps.touch_median_s,
        tap_release_s=preset.taps.release_median_s,
        tap_spread_s=preset.taps.spread_s,
    )
