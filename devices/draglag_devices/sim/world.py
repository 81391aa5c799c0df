"""The simulated rig: hand, panel, laser and WALT."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from draglag.protocol.runs import PlannedRun
from draglag.protocol.targets import Tap
from draglag.recording import AxisInfo, FloatArray, Run, Taps, TouchTrace, concatenate
from draglag.simulation import Human, follow, rig_for_screen, simulate_run, simulate_taps
from draglag.simulation.effects.base import Effect
from draglag.touch_events.frames import Mapping2D
from draglag_devices.sim.clocks import DeviceClock, random_clock
from draglag_devices.stage import contact_changes
from draglag_devices.timeline import Timeline

# Device units of the simulated digitiser, (xx, xy, x0), (yx, yy, y0) from mm: it is mounted on its side, a little
# askew, as its host must find out by calibration. Runs come in true mm unless one is in use.
DIGITISER = np.array([[0.4, 50.0, 310.0], [-50.1, 0.2, 40_000.0]])
AXES = (AxisInfo("ABS_MT_POSITION_X", 0, 32767, 50), AxisInfo("ABS_MT_POSITION_Y", 0, 40960, 50))
# A target touched with care: how far off the cross, and for how long.
_AIM_MM = 0.2
_HOLD_S = 0.4

# How often the drivers of laser and WALT compare clocks.
_SYNC_EVERY_S = 1.0


class World:
    """Computes each run ahead, onto the sources' timelines. Thread-safe.

    Seed and order of calls determine hand and instruments, whenever runs begin.

    ``truth``, ``true_taps``: runs and taps in exact host times.
    """

    def __init__(
        self,
        screen_name: str = "screen-1",
        seed: int = 0,
        start_s: float = 0.0,
        *,
        human: Human | None = None,
        effects: Sequence[Effect] = (),
    ) -> None:
        self._lock = threading.Lock()
        self._rng = np.random.default_rng(seed)
        # How often clocks are compared depends on how long the session takes; what the hand does shall not.
        self._sync_rng = np.random.default_rng([seed, 1])
        self.rig = rig_for_screen(screen_name)
        self._human = human or Human()
        self._effects = tuple(effects)
        self._start_s = start_s
        self.timelines = {"touch": Timeline(), "laser": Timeline(), "walt": Timeline()}
        self.truth: list[Run] = []
        self.true_taps: list[Taps] = []
        self.clocks: dict[str, DeviceClock] = {
            "touch": random_clock(self._rng, 1e-6),
            "laser": random_clock(self._rng, 1e-8),
            "walt": random_clock(self._rng, 1e-6),
        }
        self._contacts = 0
        self._calibration: Mapping2D | None = None
        self._synced_s = start_s
        # Drivers compare clocks several times while they open.
        self._sync(np.asarray(start_s + 1e-3 * np.arange(1, 6), np.float64))

    def begin_run(self, planned: PlannedRun, start_s: float, run_id: str) -> None:
        """The hand follows the target."""
        with self._lock:
            motion = follow(planned.target, self._human, self._rng)
            run = simulate_run(
                self.rig,
                motion,
                run_id=run_id,
                planned=planned,
                start_s=start_s,
                rng=self._rng,
                effects=self._effects,
                session_start_s=self._start_s,
            )
            touch = self._digitised(self._numbered(run.touch))
            touch = replace(touch, device_t_s=self.clocks["touch"].stamp(touch.t_s))
            laser = replace(
                run.laser,
                device_t_s=self.clocks["laser"].stamp(run.laser.t_s),
                epoch=np.zeros(len(run.laser.t_s), np.int64),
            )
            self.truth.append(replace(run, touch=touch, laser=laser))
            self._sync_until(start_s + planned.duration_s + 1.0)
            self.timelines["touch"].add(touch=touch, contacts=contact_changes(touch, self._scan_s))
            self.timelines["laser"].add(laser=laser)

    def use_calibration(self, mapping: Mapping2D) -> None:
        """Map positions from the digitiser's units from now on."""
        self._calibration = mapping

    def begin_touch(self, x_mm: float, y_mm: float, start_s: float) -> None:
        """The hand touches for 0.4 s, within about 0.2 mm."""
        with self._lock:
            t_s = np.arange(start_s, start_s + _HOLD_S, self._scan_s)
            x, y = (
                centre + self._rng.normal(0, _AIM_MM) + self._rng.normal(0, self.rig.noise_mm, len(t_s))
                for centre in (x_mm, y_mm)
            )
            self._contacts += 1
            touch = self._digitised(TouchTrace(t_s, x, y, np.full(len(t_s), self._contacts, np.int64)))
            self.timelines["touch"].add(touch=touch, contacts=contact_changes(touch, self._scan_s))

    def begin_taps(self, tap: Tap, start_s: float) -> None:
        """The WALT pen taps, with the rig's latencies."""
        with self._lock:
            taps = simulate_taps(
                self.rig,
                tap.count,
                start_s=start_s,
                rng=self._rng,
                interval_s=tap.interval_s,
                effects=self._effects,
                session_start_s=self._start_s,
            )
            self.true_taps.append(taps)
            seen_s = taps.registered_s.reshape(-1, 2)
            self._sync_until(start_s + tap.duration_s + 1.0)
            # The accelerometer feels that something happened, not what.
            n = len(taps.physical_s)
            shocks = Taps(taps.physical_s, np.full(n, np.nan), np.full(n, -1, np.int64))
            self.timelines["walt"].add(taps=shocks)
            touch = self._digitised(concatenate([self._one_tap(tap, down_s, up_s) for down_s, up_s in seen_s]))
            touch = replace(touch, device_t_s=self.clocks["touch"].stamp(touch.t_s))
            changes = contact_changes(touch, 0.0)
            changes.t_s[1::2] = seen_s[:, 1]
            self.timelines["touch"].add(touch=touch, contacts=changes)

    def stop(self) -> None:
        with self._lock:
            for timeline in self.timelines.values():
                timeline.cut()
            # Comparisons of clocks went with the rest: the next run starts them again.
            given = [t.given_until_s for t in self.timelines.values() if np.isfinite(t.given_until_s)]
            self._synced_s = min(self._synced_s, max(given, default=self._synced_s))

    @property
    def _scan_s(self) -> float:
        return 1.0 / self.rig.touch_rate_hz

    def _one_tap(self, tap: Tap, first_s: float, lift_s: float) -> TouchTrace:
        t_s = np.arange(first_s, lift_s, self._scan_s)
        noise = self.rig.noise_mm
        x, y = (centre + self._rng.normal(0, noise, len(t_s)) for centre in (tap.x_mm, tap.y_mm))
        self._contacts += 1
        return TouchTrace(t_s, x, y, np.full(len(t_s), self._contacts, np.int64))

    def _digitised(self, touch: TouchTrace) -> TouchTrace:
        (xx, xy, x0), (yx, yy, y0) = DIGITISER
        x_raw = np.round(xx * touch.x_mm + xy * touch.y_mm + x0)
        y_raw = np.round(yx * touch.x_mm + yy * touch.y_mm + y0)
        touch = replace(touch, x_raw=x_raw, y_raw=y_raw, axes=AXES)
        if self._calibration is not None:
            x_mm, y_mm = self._calibration(x_raw, y_raw)
            touch = replace(touch, x_mm=x_mm, y_mm=y_mm)
        return touch

    def _numbered(self, touch: TouchTrace) -> TouchTrace:
        n = len(touch.t_s)
        ids = touch.contact_id if len(touch.contact_id) == n else np.zeros(n, np.int64)
        if n == 0:
            return touch
        new = ids - ids.min() + self._contacts + 1
        self._contacts = int(new.max())
        return replace(touch, contact_id=new)

    def _sync_until(self, until_s: float) -> None:
        host_s = np.arange(self._synced_s + _SYNC_EVERY_S, until_s, _SYNC_EVERY_S)
        if len(host_s):
            self._synced_s = float(host_s[-1])
            self._sync(host_s)

    def _sync(self, host_s: FloatArray) -> None:
        for role in ("laser", "walt"):
            self.timelines[role].add(clock=self.clocks[role].bounds(role, host_s, self._sync_rng))
