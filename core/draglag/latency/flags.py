"""What the flags of an estimate and of a validation mean."""

from __future__ import annotations

from collections.abc import Iterable

MEANING = {
    "no_touch": "no touch events: was the stylus on the screen, and is the touch device the right one?",
    "no_edges": "the laser saw nothing: is the beam on the sensor, and low enough for the stylus to block it?",
    "few_edges": "fewer than eight usable edges: the interval is wide; let the run last longer",
    "at_window_end": "the latency lies at the end of the searched window: it is not in the curve; widen the window",
    "unidentifiable": "the data do not determine a latency: more edges, more sideways travel, both directions",
    "alias": "a latency half a circle's period away fits about as well: given is that nearest to other runs', if any",
    "spurious_edges": "more than a tenth of the edges were made by something other than the stylus",
    "lost_contact": "a tenth of the edges or more fell into a loss of contact",
    "little_travel": "the circle's centre travels less than a quarter of its diameter: slope and latency look alike",
    "excess_scatter": "the edges scatter more than the touch noise explains",
    "missed_edges": "the sensor reported edges that it could not stamp",
    "device_gap": "a device was away or was read too late during the run: samples may be missing; close other programs",
    "stray_touches": "touch events far off the path were left out: another contact, or a driver that reports zeros",
    "coarse_stamps": "touch stamps lie on a coarse grid, within which the latency is unknown: record finer ones",
    "aborted": "the run was aborted: it is not in the curve; record it again, or include it by hand",
    "device_lost": "a device was lost during the run: it is not in the curve; record it again, or include it by hand",
    "failed": "the run failed: it is not in the curve; record it again, or include it by hand",
    "practice": "the run was practice: it is not in the curve; include it by hand if it should be",
    "standstill": "the program or the computer stood still during the run: it is not in the curve; record it again",
    "laser_missing": "the laser saw less than half of the passes: it is not in the curve; check the laser's alignment",
    "far_from_nominal": "the speed was less than half or more than twice the nominal one: it is not in the curve",
    "off_speed": "the speed was more than a quarter off the nominal one: the curve uses the measured speed",
    "speed_changed": "the speed changed midway by more than half: it is not in the curve; record it again",
    "uneven_trace": "the stylus crosses evenly, its trace does not: it is not in the curve; turn far from the beam",
    "clock_uncertain": "the laser's clock may shift the latency by more than 1 ms: compare the clocks again",
    "clock_unknown": "the laser's clock was never compared with the host's: a shift of the latency would not show",
    "extrapolated": "more than a tenth of the edges were crossed at speeds at which the curve was not measured",
}


def meanings(flags: Iterable[str]) -> dict[str, str]:
    """Flag → meaning, each flag once; without flags of other packages' estimators, which are not known here."""
    return {flag: MEANING[flag] for flag in flags if flag in MEANING}
