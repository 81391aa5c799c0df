"""What the flags of an estimate mean, in the operator's words."""

MEANING = {
    "no_touch": "no touch events: was the stylus on the screen, and is the touch device the right one?",
    "few_edges": "fewer than eight usable edges: the interval is wide; let the run last longer",
    "at_window_end": "the best latency lies at the end of the searched window: widen the window",
    "unidentifiable": "the data do not determine a latency: more edges, more sideways travel, both directions",
    "alias": "a latency half a circle's period away fits about as well",
    "spurious_edges": "more than a tenth of the edges were made by something other than the stylus",
    "lost_contact": "a tenth of the edges or more fell into a loss of contact",
    "little_travel": "the circle's centre travels less than a quarter of its diameter: slope and latency look alike",
    "excess_scatter": "the edges scatter more than the touch noise explains",
    "missed_edges": "the sensor reported edges that it could not stamp",
    "device_gap": "a device was away during the run",
    "aborted": "the run was aborted: it is not in the curve; record it again, or include it by hand",
    "device_lost": "a device was lost during the run: it is not in the curve; record it again, or include it by hand",
    "failed": "the run failed: it is not in the curve; record it again, or include it by hand",
    "laser_missing": "the laser saw less than half of the passes: it is not in the curve; check the laser's alignment",
    "far_from_nominal": "the speed was less than half or more than twice the nominal one: it is not in the curve",
    "off_speed": "the speed was more than a quarter off the nominal one: the curve uses the measured speed",
    "speed_changed": "the speed changed midway by more than half: it is not in the curve; record it again",
    "clock_uncertain": "the laser's clock may shift the latency by more than 1 ms: compare the clocks again",
    "clock_unknown": "the laser's clock was never compared with the host's: a shift of the latency would not show",
}
