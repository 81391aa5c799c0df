"""Detector of laser edges that chatter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from draglag.gap.streams.stamps import StreamEffect, Streams, share_interval
from draglag.messages import message
from draglag.recording import Run, Session
from draglag.simulation.effects.laser_bounce import LaserBounce

STAMP_S = 1e-6  # to which edges are stamped
P_OUTLIER = 1e-4  # chance that the longest of a chatter lies so far beyond the next


def detect(streams: Streams, runs: tuple[Run, ...]) -> tuple[StreamEffect | None, tuple[Run, ...]]:
    """Chatter; runs unchanged, as every estimate leaves it out."""
    return chatter(streams.session), runs


def chatter(session: Session) -> StreamEffect | None:
    """Groups of transitions closer than any stylus allows."""
    runs = [_grouped(run, session.stylus.diameter_mm) for run in session.runs
            if run.laser.t_s.size >= 6 and run.touch.t_s.size >= 50]  # fmt: skip
    extra, edges = _counts(runs)
    if edges == 0 or extra < max(5, 0.02 * edges) or not any(run.spans_s for run in runs):
        return None
    span_s = _longest_span_s([span for run in runs for span in run.spans_s])
    # Chatter that outlasts what is near in a fast run is cut there; where every run cuts it, the slowest gives a lower
    # bound.
    uncut = [run for run in runs if run.near_s >= span_s]
    near_least_s = span_s if uncut else max(run.near_s for run in runs)
    slow = [run for run in runs if run.near_s >= near_least_s]
    used, of = _counts(slow)
    if not used:
        used, of = extra, edges
    seen = sum(span <= span_s for run in slow for span in run.spans_s)
    longest_s = span_s * 0.05 ** (-1 / (2 * max(seen, 1)))
    share = used / of
    low, high = share_interval(used, of)
    return StreamEffect(
        LaserBounce.id,
        "span_s",
        span_s,
        (span_s - STAMP_S, longest_s),
        message("{share:.0f} % of edges", share=100 * share),
        f"{extra} of {edges} edges chatter for up to {1e3 * span_s:.2f} ms",
        extra / edges,
        also=(("share", share, (low, high if uncut else 1.0)),),
    )


@dataclass(frozen=True)
class _Groups:
    """One run's groups of transitions closer than near_s; spans_s: durations of chatters."""

    near_s: float
    chattering: int
    groups: int
    spans_s: tuple[float, ...]


def _counts(runs: list[_Groups]) -> tuple[int, int]:
    """Chattering and all groups."""
    return sum(run.chattering for run in runs), sum(run.groups for run in runs)


def _grouped(run: Run, diameter_mm: float) -> _Groups:
    """Groups too close for the stylus at the run's highest speed."""
    t = np.sort(run.laser.t_s)
    near_s = min(0.3 * diameter_mm / max(_fastest(run), 1.0), 0.006)
    starts = np.append(True, ~(np.diff(t) < near_s))
    size = np.bincount(np.cumsum(starts) - 1)
    begin = np.flatnonzero(starts)
    # A chattering edge ends in its new state, after three transitions or more; two are a pass that grazes the beam, an
    # even number two edges so close that their chatter meets.
    whole = (float(t[b + n - 1] - t[b]) for b, n in zip(begin, size, strict=True) if n > 2 and n % 2)
    return _Groups(near_s, int(np.sum(size > 2)), int(size.size), tuple(whole))


def _longest_span_s(each_s: list[float]) -> float:
    # The longest chatter bounds the time in which it may: of n edges' last of two flips, one lies within its last
    # part q with 1 − (1 − q)²ⁿ. The median lies at 0.7 of it or beyond; what lasts twice that is something else.
    spans = sorted(span for span in each_s if span <= 2 * float(np.median(each_s)))
    # Nor is the longest an outlier: there two edges were close, and one of them chattered.
    while len(spans) > 2 and spans[-1] > spans[-2] * P_OUTLIER ** (-1 / (2 * len(spans) - 2)):
        spans.pop()
    return spans[-1]


def _fastest(run: Run) -> float:
    t, x, y = run.touch.t_s, run.touch.x_mm, run.touch.y_mm
    step = max(1, round(0.03 / max(float(np.median(np.diff(t))), 1e-4)))
    if t.size <= step:
        return 1000.0
    dt = np.maximum(t[step:] - t[:-step], 1e-6)
    return float(np.percentile(np.hypot(x[step:] - x[:-step], y[step:] - y[:-step]) / dt, 90))
