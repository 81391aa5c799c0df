"""Whether a run has one speed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from draglag.latency.edges import Edges, clean_edges
from draglag.latency.estimate import FEWEST_EDGES, GUESS_S, fastest_mm_s
from draglag.messages import message
from draglag.path.events import last_of_batches, sample_interval_s, usable
from draglag.path.local_fit import LocalFit, local_fit
from draglag.recording import FloatArray, Run, TouchTrace

AT_REST_MM_S = 1e-3  # a trace of one point has speeds of 1e-14 mm/s by rounding. Derived
# Faster over slower speed of a run: a mean over two speeds is no point of a curve that bends. Judgement
CHANGED = 1.5
SPREAD = (CHANGED - 1) / (CHANGED + 1)  # standard deviation over mean of two speeds that far apart. Derived
LISTED = 5  # ids in a sentence. Judgement
HALF_S = 0.1  # half window of a speed: hands change theirs at 1 to 3 Hz. Physical


def has_constant_speed(run: Run) -> bool:
    """Whether one latency describes the run: a circle, or a free drag whose speed at the edges spreads little.

    Trace or light may say so, for what misleads either adds to its spread: a trace is read at a guessed latency, over a
    window into which the turns of quick strokes fall, and may leap out of them. Where light alone does,
    ``latency.conduct`` looks at the trace again, at the latency found.
    """
    if run.protocol != "free":
        return run.protocol == "circle"
    return spread_in_trace(run) <= SPREAD or _spread_in_light(run) <= SPREAD


def changing_warnings(changing: Sequence[str]) -> list[str]:
    """Words on free drags, by their ids, that were compared with the curve and are no points of it; none without."""
    if not changing:
        return []
    return [
        message(
            "1 free drag changes its speed: compared with the curve, no point of it ({runs})"
            if len(changing) == 1
            else "{n} free drags change their speed: compared with the curve, no points of it ({runs})",
            n=len(changing),
            runs=listed(changing),
        )
    ]


def listed(ids: Sequence[str]) -> str:
    """The first ids, for a sentence."""
    return ", ".join(ids[:LISTED]) + (", …" if len(ids) > LISTED else "")


def keeps_speed(run: Run) -> bool:
    """Whether it keeps its speed between the edges, too: a circle, or a free drag that does not turn as strokes do."""
    if run.protocol == "circle":
        return True
    touch = last_of_batches(usable(run.touch))
    return touch.t_s.size < FEWEST_EDGES or _spread(touch, np.arange(touch.t_s[0], touch.t_s[-1], HALF_S)) <= SPREAD


def spread_in_trace(run: Run) -> float:
    """Standard deviation over mean of the speed at the edges; 0 of fewer than ``FEWEST_EDGES``."""
    touch = last_of_batches(usable(run.touch))
    if touch.t_s.size < FEWEST_EDGES:
        return 0.0
    return _spread(touch, run.laser.t_s[np.isfinite(run.laser.t_s)] + GUESS_S)


def _spread_in_light(run: Run) -> float:
    """The same by how long the stylus keeps the light away; infinite of fewer than ``FEWEST_EDGES`` passages.

    Across the beam its speed is its width, in the units of the trace, over that time; along it, the trace's.
    """
    touch = last_of_batches(usable(run.touch))
    edges = clean_edges(run.laser, 0.0, 1.0)
    if touch.t_s.size < FEWEST_EDGES or edges.t_s.size < FEWEST_EDGES:
        return float("inf")
    dark_s, v_mm_s = _passages(touch, edges)
    width_mm = float(np.median(np.abs(v_mm_s[:, 1]) * dark_s)) if dark_s.size else 0.0
    dark_s, v_mm_s = _passages(touch, clean_edges(run.laser, width_mm, fastest_mm_s(touch)))
    if dark_s.size < FEWEST_EDGES or not width_mm:
        return float("inf")
    speed = np.hypot(width_mm / dark_s, v_mm_s[:, 0])
    return float(speed.std() / speed.mean())


def _passages(touch: TouchTrace, edges: Edges) -> tuple[FloatArray, FloatArray]:
    """How long each passage within the trace is dark, (k,), and the trace's velocity there, (k, 2)."""
    dark = np.flatnonzero(edges.falling[:-1] & ~edges.falling[1:])
    from_s, to_s = edges.t_s[dark], edges.t_s[dark + 1]
    fit = _fitted(touch, 0.5 * (from_s + to_s) + GUESS_S)
    return (to_s - from_s)[fit.ok], fit.v_mm_s[fit.ok]


def _spread(touch: TouchTrace, at_s: FloatArray) -> float:
    fit = _fitted(touch, at_s)
    speed = fit.speed_mm_s[fit.ok]
    moves = speed.size >= FEWEST_EDGES and float(speed.mean()) > AT_REST_MM_S
    return float(speed.std() / speed.mean()) if moves else 0.0


def _fitted(touch: TouchTrace, at_s: FloatArray) -> LocalFit:
    half_s = max(HALF_S, 4.5 * sample_interval_s(touch.t_s))
    return local_fit(touch.t_s, np.column_stack([touch.x_mm, touch.y_mm]), at_s, half_s)
