"""One simulated world acted out over the wires: what its hand did becomes touches, broken beams and shocks."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from draglag.recording import Run, Taps
from emulators.touch.live import LiveTouch, contact, lifted, moved
from emulators.walt.wires import WaltOnPty

# Frames of the panel are handed to the driver this much before their stamps: a machine that is held up for less
# changes nothing.
AHEAD_S = 0.5


class Segment(Protocol):
    """What is needed of the emulated field bus."""

    def edges(self, edges: list[tuple[int, int, int]], relative: bool = False) -> int: ...


def play_touch(panel: LiveTouch, run: Run, shift_s: float, units_per_mm: float = 10.0) -> None:
    """Touch events at their times, shifted; whole units, as a panel has them."""
    touch = run.touch
    ids = touch.contact_id if len(touch.contact_id) == len(touch.t_s) else np.zeros(len(touch.t_s), int)
    x, y = (np.rint(units_per_mm * mm).astype(int) for mm in (touch.x_mm, touch.y_mm))
    timed: list[tuple[float, list[list[int]]]] = []
    for k, at_s in enumerate((touch.t_s + shift_s).tolist()):
        new = k == 0 or ids[k] != ids[k - 1]
        if new and k:
            timed.append((at_s - 1e-3, lifted(0)))
        put = contact(0, int(ids[k]) % 65536, int(x[k]), int(y[k])) if new else moved(0, int(x[k]), int(y[k]))
        timed.append((at_s, put))
    if len(touch.t_s):
        timed.append((float(touch.t_s[-1]) + shift_s + 0.01, lifted(0)))
    panel.frames(timed, AHEAD_S)


def play_laser(run: Run, shift_s: float, *, walt: WaltOnPty | None = None, segment: Segment | None = None) -> None:
    """Edges at their times, shifted, on the WALT's laser or channel 1 of the field bus."""
    at_s = run.laser.t_s + shift_s
    if walt is not None:
        walt.edges(at_s, run.laser.light)
    if segment is not None:
        nanos = np.rint(1e9 * at_s).astype(np.int64).tolist()
        segment.edges([(at, 1, int(level)) for at, level in zip(nanos, run.laser.light, strict=True)])


def play_taps(panel: LiveTouch, walt: WaltOnPty, taps: Taps, shift_s: float, hold_s: float = 0.0) -> None:
    """Shocks of the pen, and the touches that the panel reports later; it lifts ``hold_s`` later than it did."""
    later_s = shift_s + np.where(taps.down == 1, 0.0, hold_s)
    walt.shocks(np.sort(taps.physical_s + later_s))
    events = sorted(zip((taps.registered_s + later_s).tolist(), taps.down.tolist(), strict=True))
    panel.frames(
        [(at_s, contact(0, k % 65536, 1000, 1000) if down else lifted(0)) for k, (at_s, down) in enumerate(events)],
        AHEAD_S,
    )
