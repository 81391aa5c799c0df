"""Edges of the laser that chatter."""

from __future__ import annotations

import numpy as np

from draglag.gap.streams.stamps import StreamEffect, Streams, share_interval
from draglag.recording import Run, Session
from draglag.simulation.effects.laser_bounce import LaserBounce

STAMP_S = 1e-6  # to which edges are stamped
P_OUTLIER = 1e-4  # chance that the longest of a chatter lies so far beyond the next


def detect(streams: Streams, runs: tuple[Run, ...]) -> tuple[StreamEffect | None, tuple[Run, ...]]:
    """Chatter; every estimate leaves it out by itself."""
    return chatter(streams.session), runs


def chatter(session: Session) -> StreamEffect | None:
    """Chatter: transitions closer together than any stylus allows, in groups around single edges."""
    groups: list[tuple[float, int, int]] = []  # of each run: how near, groups that chatter, groups
    each: list[tuple[float, float]] = []  # of each chatter: how near is near in its run, how long it lasted
    for run in session.runs:
        t = np.sort(run.laser.t_s)
        if t.size < 6 or run.touch.t_s.size < 50:
            continue
        fastest = _fastest(run)
        closest = 0.3 * session.stylus.diameter_mm / max(fastest, 1.0)
        closest = min(closest, 0.006)
        near = np.diff(t) < closest
        starts = np.append(True, ~near)
        size = np.bincount(np.cumsum(starts) - 1)
        begin = np.flatnonzero(starts)
        # A chattering edge ends in its new state, after three transitions or more; two are a pass that grazes the beam,
        # an even number two edges so close that their chatter meets.
        whole = [float(t[b + n - 1] - t[b]) for b, n in zip(begin, size, strict=True) if n > 2 and n % 2]
        each += [(closest, span) for span in whole]
        groups.append((closest, int(np.sum(size > 2)), int(size.size)))
    extra, edges = (int(sum(group[k] for group in groups)) for k in (1, 2))
    if edges == 0 or extra < max(5, 0.02 * edges) or not each:
        return None
    # The longest chatter bounds the time in which it may: of n edges' last of two flips, one lies within its last
    # part q with 1 − (1 − q)²ⁿ. The median lies at 0.7 of it or beyond; what lasts twice that is something else.
    longest = 2 * float(np.median([span for _, span in each]))
    spans = sorted(span for _, span in each if span <= longest)
    # Nor does the longest stand apart from the next: there two edges were close, and one of them chattered.
    while len(spans) > 2 and spans[-1] > spans[-2] * P_OUTLIER ** (-1 / (2 * len(spans) - 2)):
        spans.pop()
    span_s = spans[-1]
    # Chatter that outlasts what is near in a fast run falls apart there; where it does so in every run, the slowest
    # gives a lower bound.
    whole_in = [group for group in groups if group[0] >= span_s]
    near_least_s = span_s if whole_in else max(group[0] for group in groups)
    used, of = (int(sum(group[k] for group in groups if group[0] >= near_least_s)) for k in (1, 2))
    if not used:
        used, of = extra, edges
    seen = sum(near_s >= near_least_s and span <= span_s for near_s, span in each)
    longest_s = span_s * 0.05 ** (-1 / (2 * max(seen, 1)))
    share = used / of
    low, high = share_interval(used, of)
    return StreamEffect(
        LaserBounce.id,
        "span_s",
        span_s,
        (span_s - STAMP_S, longest_s),
        f"{100 * share:.0f} % of edges",
        f"{extra} of {edges} edges chatter for up to {1e3 * span_s:.2f} ms",
        extra / edges,
        also=(("share", share, (low, high if whole_in else 1.0)),),
    )


def _fastest(run: Run) -> float:
    t, x, y = run.touch.t_s, run.touch.x_mm, run.touch.y_mm
    step = max(1, round(0.03 / max(float(np.median(np.diff(t))), 1e-4)))
    if t.size <= step:
        return 1000.0
    dt = np.maximum(t[step:] - t[:-step], 1e-6)
    return float(np.percentile(np.hypot(x[step:] - x[:-step], y[step:] - y[:-step]) / dt, 90))
