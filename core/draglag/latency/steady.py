"""Whether a run has one speed."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from draglag.latency.estimate import FEWEST_EDGES, GUESS_S
from draglag.messages import message
from draglag.path.events import last_of_batches, sample_interval_s, usable
from draglag.path.local_fit import local_fit
from draglag.recording import FloatArray, Run, TouchTrace

# Faster over slower speed of a run: a mean over two speeds is no point of a curve that bends. Judgement
CHANGED = 1.5
SPREAD = (CHANGED - 1) / (CHANGED + 1)  # standard deviation over mean of two speeds that far apart. Derived
LISTED = 5  # ids in a sentence. Judgement
HALF_S = 0.1  # half window of a speed: hands change theirs at 1 to 3 Hz. Physical


def has_constant_speed(run: Run) -> bool:
    """Whether one latency describes the run: a circle, or a free drag whose speed at the edges spreads little."""
    return run.protocol == "circle" or (run.protocol == "free" and speed_spread(run) <= SPREAD)


def changing_warnings(runs: Iterable[Run]) -> list[str]:
    """Words on free drags that are no points of the curve; none without."""
    changing = [run.id for run in runs if run.protocol == "free" and not has_constant_speed(run)]
    if not changing:
        return []
    listed = ", ".join(changing[:LISTED]) + (", …" if len(changing) > LISTED else "")
    return [
        message(
            "1 free drag changes its speed: compared with the curve, no point of it ({runs})"
            if len(changing) == 1
            else "{n} free drags change their speed: compared with the curve, no points of it ({runs})",
            n=len(changing),
            runs=listed,
        )
    ]


def keeps_speed(run: Run) -> bool:
    """Whether it keeps its speed between the edges, too: a circle, or a free drag that does not turn as strokes do."""
    if run.protocol == "circle":
        return True
    touch = last_of_batches(usable(run.touch))
    return touch.t_s.size < FEWEST_EDGES or _spread(touch, np.arange(touch.t_s[0], touch.t_s[-1], HALF_S)) <= SPREAD


def speed_spread(run: Run) -> float:
    """Standard deviation over mean of the speed at the edges; 0 of fewer than ``FEWEST_EDGES``."""
    touch = last_of_batches(usable(run.touch))
    if touch.t_s.size < FEWEST_EDGES:
        return 0.0
    return _spread(touch, run.laser.t_s[np.isfinite(run.laser.t_s)] + GUESS_S)


def _spread(touch: TouchTrace, at_s: FloatArray) -> float:
    half_s = max(HALF_S, 4.5 * sample_interval_s(touch.t_s))
    fit = local_fit(touch.t_s, np.column_stack([touch.x_mm, touch.y_mm]), at_s, half_s)
    speed = fit.speed_mm_s[fit.ok]
    return float(speed.std() / speed.mean()) if speed.size >= FEWEST_EDGES and speed.any() else 0.0
