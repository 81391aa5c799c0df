"""The phase of a host's ticks, which no recording has: a simulated run has another than the measured one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from draglag.gap.replaying.hand_path import COARSE
from draglag.path.events import usable
from draglag.path.local_fit import local_fit
from draglag.recording import TouchTrace
from draglag.simulation.kinematics import GRID_HZ


def in_phase(simulated: TouchTrace, measured: TouchTrace, half_s: float) -> TouchTrace:
    """Simulated trace, moved in time to where the measured one lies. half_s: of windows that events are smoothed in.

    Its frames wait for other ticks, and are later or earlier by up to one, all alike.
    """
    traces = [usable(touch) for touch in (measured, simulated)]
    if not all(touch.t_s.size for touch in traces):
        return simulated
    at_s = np.arange(max(t.t_s[0] for t in traces), min(t.t_s[-1] for t in traces), COARSE / GRID_HZ)
    was, now = (local_fit(t.t_s, np.column_stack([t.x_mm, t.y_mm]), at_s, half_s) for t in traces)
    both = was.ok & now.ok
    velocity_mm_s = was.v_mm_s[both]
    if not velocity_mm_s.any():
        return simulated
    early_s = np.sum((now.xy_mm - was.xy_mm)[both] * velocity_mm_s) / np.sum(velocity_mm_s**2)
    return replace(simulated, t_s=simulated.t_s + early_s)
