"""What shows in the streams themselves, before any residual: tick grids, repeats, batches, quanta, chatter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from draglag.gap.streams.fills import filled_losses
from draglag.gap.streams.holding import first_of_repeats, hold, resolution_mm, still_uneven
from draglag.gap.streams.polled import polled, unpolled
from draglag.gap.streams.stamps import StreamEffect, batches, coarse_clock, drops, evened, share_interval, spread
from draglag.gap.streams.standing import deadband
from draglag.gap.streams.unheld import unheld
from draglag.recording import Run, Session, TouchTrace

STAMP_S = 1e-6  # to which edges are stamped
STANDS_APART = 1e-4  # chance that the longest of a chatter lies so far beyond the next
UNSURE = 0.3  # of the share of missing frames, where a coarse clock leaves open which frame a stamp is of


def inspect(session: Session) -> tuple[tuple[StreamEffect, ...], Session]:
    """Effects that the streams give away, and the session with them repaired as far as they can be.

    The raw session is untouched: the repaired one is a copy for the residual tests.
    """
    found: list[StreamEffect] = []
    touches = [run.touch for run in session.runs if run.touch.t_s.size > 50]
    if not touches:
        return (), session
    runs = session.runs
    bounced = _bounce(session)
    if bounced is not None:
        found.append(bounced[0])
    step_mm = resolution_mm(touches)
    waited, stood = polled(touches), deadband(touches, step_mm)
    batched, held, coarse = batches(touches), hold(touches, step_mm), coarse_clock(touches)
    if stood is not None:
        held = None  # what repeats is no loop's, and no straight line
    if waited is not None:
        # Its empty ticks, groups and uneven ages are those of its beat.
        found.append(waited.effect)
        runs = tuple(replace(r, touch=unpolled(r.touch, waited.effect.value, waited.frame_s)) for r in runs)
        batched = coarse = held = None
    elif batched is not None:
        found.append(batched)
        runs = tuple(replace(r, touch=spread(r.touch, round(batched.value))) for r in runs)
    elif coarse is not None:
        # A grid of stamps without repeated positions is a coarse clock; with them it is a loop that holds.
        found.append(coarse)
        runs = tuple(replace(r, touch=evened(r.touch, coarse.value)) for r in runs)
    elif held is not None:
        first = [first_of_repeats(r.touch) for r in runs]
        even = unheld(first, 1 / held.value)
        if even is not None and still_uneven(first, even, 1 / held.value):
            even = None  # another beat was taken for theirs
        found.append(replace(held, undone=even is not None))
        runs = tuple(replace(r, touch=touch) for r, touch in zip(runs, even or first, strict=True))
    told = held is None if coarse is None else not coarse.undone
    if batched is None and waited is None and told:
        found += _dropped(touches, coarse is None)
    if stood is not None:
        found.append(stood)
        runs = tuple(replace(r, touch=first_of_repeats(r.touch)) for r in runs)
    lost, runs = filled_losses(runs, held is not None, step_mm)
    if lost is not None:
        found.append(lost)
    return tuple(found), replace(session, runs=runs)


def _dropped(touches: list[TouchTrace], sure: bool) -> list[StreamEffect]:
    """Missing frames, if there are; ``sure``: whether stamps show which frame they are of."""
    dropped = drops(touches)
    if dropped is None:
        return []
    low, high = (
        one if sure else share * one for share, one in zip((1 - UNSURE, 1 + UNSURE), dropped.ci95, strict=True)
    )
    return [replace(dropped, ci95=(low, min(high, 1.0)))]


def _bounce(session: Session) -> tuple[StreamEffect] | None:
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
    # Of the time in which it may chatter the longest tells: of n edges' last of two flips, one lies within its last
    # part q with 1 − (1 − q)²ⁿ. The median lies at 0.7 of it or beyond; what lasts twice that is something else.
    longest = 2 * float(np.median([span for _, span in each]))
    spans = sorted(span for _, span in each if span <= longest)
    # Nor does the longest stand apart from the next: there two edges were close, and one of them chattered.
    while len(spans) > 2 and spans[-1] > spans[-2] * STANDS_APART ** (-1 / (2 * len(spans) - 2)):
        spans.pop()
    span_s = spans[-1]
    # Chatter that outlasts what is near in a fast run falls apart there; where it does so in every run, the slowest
    # tells at least.
    whole_in = [group for group in groups if group[0] >= span_s]
    near_least_s = span_s if whole_in else max(group[0] for group in groups)
    told, of = (int(sum(group[k] for group in groups if group[0] >= near_least_s)) for k in (1, 2))
    if not told:
        told, of = extra, edges
    seen = sum(near_s >= near_least_s and span <= span_s for near_s, span in each)
    longest_s = span_s * 0.05 ** (-1 / (2 * max(seen, 1)))
    share = told / of
    low, high = share_interval(told, of)
    return (
        StreamEffect(
            "laser_bounce",
            "span_s",
            span_s,
            (span_s - STAMP_S, longest_s),
            f"{100 * share:.0f} % of edges",
            f"{extra} of {edges} edges chatter for up to {1e3 * span_s:.2f} ms",
            extra / edges,
            also=(("share", share, (low, high if whole_in else 1.0)),),
        ),
    )


def _fastest(run: Run) -> float:
    t, x, y = run.touch.t_s, run.touch.x_mm, run.touch.y_mm
    step = max(1, round(0.03 / max(float(np.median(np.diff(t))), 1e-4)))
    if t.size <= step:
        return 1000.0
    dt = np.maximum(t[step:] - t[:-step], 1e-6)
    return float(np.percentile(np.hypot(x[step:] - x[:-step], y[step:] - y[:-step]) / dt, 90))
