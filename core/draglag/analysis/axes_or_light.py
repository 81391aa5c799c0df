"""What would give the runs of a session latencies, where few have a sound one: axes exchanged, or light inverted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from draglag.latency import RunEstimate, estimate_run
from draglag.messages import message
from draglag.recording import Run

TRIED = 3  # runs, with the most edges. Derived: cost; by chance none fits
Change = Callable[[Run], Run]


def _exchanged(run: Run) -> Run:
    touch = run.touch
    return replace(run, touch=replace(touch, x_mm=touch.y_mm, y_mm=touch.x_mm))


def _inverted(run: Run) -> Run:
    return replace(run, laser=replace(run.laser, light=1 - run.laser.light))


def axes_or_light(runs: Sequence[Run], estimates: Sequence[RunEstimate], stylus_diameter_mm: float) -> list[str]:
    """One sentence on the change that gives the longest runs latencies without a flag, where few have a sound one."""
    bad = sum(one.latency_s is None or "excess_scatter" in one.flags for one in estimates)
    longest = sorted(runs, key=lambda run: -run.laser.t_s.size)[:TRIED]
    if len(longest) < TRIED or 2 * bad <= len(estimates):
        return []
    changes: tuple[tuple[Change, str], ...] = (
        (
            _exchanged,
            message(
                "Few runs have a sound latency, but they would with x and y exchanged: the beam seems to stand "
                "upright. Import the session with x and y exchanged, width and height of the screen too"
            ),
        ),
        (
            _inverted,
            message(
                "Few runs have a sound latency, but they would with the light inverted: give 1 where the sensor sees "
                "the laser"
            ),
        ),
    )
    for change, sentence in changes:
        tried = [estimate_run(change(run), stylus_diameter_mm) for run in longest]
        if all(one.latency_s is not None and not one.flags for one in tried):
            return [sentence]
    return []
