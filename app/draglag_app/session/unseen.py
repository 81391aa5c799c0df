"""What a run that has begun lacks."""

from __future__ import annotations

import numpy as np

from draglag.messages import message
from draglag.recording import Beam, Run, Screen

# Nearer to the beam, which is known to the ruler's precision or taken to be in the middle, no side is certain.
_NEAR_MM = 8.0
_FEWEST_PASSES = 2


def no_touch(run: Run, after_s: float) -> str:
    """A sentence if no touch has come, else empty."""
    if len(run.touch.t_s):
        return ""
    return message(
        "No touch has come in the first {seconds:.0f} s of {run}: check that the stylus is on the screen under "
        "test and that this is the touchscreen in use.",
        seconds=after_s,
        run=run.id,
    )


def no_edges(run: Run, beam: Beam | None, screen: Screen) -> str:
    """A sentence if the stylus has passed the beam and the laser saw nothing, else empty.

    ``beam`` None: in the middle of the screen.
    """
    if len(run.laser.t_s):
        return ""
    slope, intercept_mm = (0.0, screen.height_mm / 2) if beam is None else (beam.slope, beam.intercept_mm)
    off_mm = run.touch.y_mm - slope * run.touch.x_mm - intercept_mm
    side = np.sign(off_mm[np.abs(off_mm) > _NEAR_MM])
    passes = int((side[1:] != side[:-1]).sum())
    if passes < _FEWEST_PASSES:
        return ""
    return message(
        "The stylus has passed the beam {n} times in {run}, and the laser saw nothing: check that the beam is on, "
        "reaches the sensor and is low enough for the stylus to block it. Block it by hand: the count of edges must "
        "follow.",
        n=passes,
        run=run.id,
    )
