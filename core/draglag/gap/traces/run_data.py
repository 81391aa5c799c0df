"""Runs of a session, ready for the joint fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_matrix

from draglag.errors import EstimateError
from draglag.gap.constants import HAND_STEP_S
from draglag.gap.traces.dewarped import Shown, Spectrum, shown_speed, spectrum_of
from draglag.gap.traces.law_speed import COARSE_S, padded
from draglag.gap.traces.searched import searched
from draglag.gap.traces.steep import wide_enough
from draglag.latency.conduct import Estimates
from draglag.latency.estimate import FEWEST_EDGES, GUESS_S, RunEstimate, prepare
from draglag.latency.steady import has_constant_speed, keeps_speed
from draglag.messages import message
from draglag.path.events import contact_losses, sample_interval_s
from draglag.path.local_fit import local_fit
from draglag.path.motion import best_half_width_s, speed_half_widths_s
from draglag.recording import FloatArray, Run, Session
from draglag.simulation.effects.in_fits import Undoing, UndoneTrace

# Of a circle, over half a window: a cubic is true there to 0.2 % of the way off its centre line. Derived.
CUBIC_RAD = 0.85


@dataclass(frozen=True, eq=False)
class RunData:
    """One run ready for the joint fit.

    t_s, xy_mm: events, means over ``HAND_STEP_S`` if finer; reported_s: each report. half_s: half window of positions.
    noise_mm: of one event. as_shown: the run before ``undone``. spread: (n, events shown) influence.
    """

    run: Run
    t_s: FloatArray
    xy_mm: FloatArray
    edge_t_s: FloatArray
    falling: np.ndarray
    half_s: float
    speed_half_s: FloatArray
    noise_mm: float
    estimate: RunEstimate | None
    guess_s: FloatArray
    reported_s: FloatArray
    undone: tuple[Undoing, ...] = ()
    spread: csr_matrix | None = None
    as_shown: RunData | None = None

    @cached_property
    def steady(self) -> bool:
        """Whether it has one speed all along, not only where it crosses the beam, as strokes have."""
        return self.estimate is not None and keeps_speed(self.run)

    @property
    def keeps_moving(self) -> bool:
        """Whether the hand does not rest; a panel's catching up is not modelled."""
        return self.steady or self.run.protocol in ("chirp", "multisine", "free")

    @cached_property
    def losses_s(self) -> FloatArray:
        """First and last time of contact losses, (k, 2)."""
        return contact_losses(self.t_s)

    @property
    def velocity_half_s(self) -> float:
        """Half window of a velocity, limited on circles."""
        wide_s = float(np.median(self.speed_half_s))
        if self.estimate is None or not self.run.radius_mm or not self.estimate.speed_mm_s:
            return wide_s
        return min(wide_s, _on_a_circle_s(self.run.radius_mm, self.estimate.speed_mm_s, sample_interval_s(self.t_s)))

    @cached_property
    def smooth_mm(self) -> FloatArray:
        """Smoothed positions at the events, (n, 2)."""
        fit = local_fit(self.t_s, self.xy_mm, self.t_s, self.half_s)
        return np.where(fit.ok[:, None], fit.xy_mm, self.xy_mm)

    @cached_property
    def quick(self) -> tuple[FloatArray, FloatArray]:
        """Times and speeds (g,), in the shortest window that noise allows."""
        step_s = max(sample_interval_s(self.t_s), HAND_STEP_S)
        grid_s = np.arange(self.t_s[0], self.t_s[-1], step_s)
        fit = local_fit(self.t_s, self.xy_mm, grid_s, float(np.median(self.speed_half_s)))
        return grid_s, np.interp(grid_s, grid_s[fit.ok], fit.speed_mm_s[fit.ok])

    @cached_property
    def usual_mm_s(self) -> float:
        return float(np.mean(self.quick[1]))

    @cached_property
    def coarse(self) -> tuple[FloatArray, FloatArray]:
        """``quick`` at fewer times."""
        grid_s = np.arange(self.quick[0][0], self.quick[0][-1], COARSE_S)
        return grid_s, np.interp(grid_s, *self.quick)

    @cached_property
    def padded(self) -> tuple[FloatArray, FloatArray]:
        """``quick`` at the few times of another moment's speed, see ``law_speed.padded``."""
        return padded(*self.quick)

    @cached_property
    def spectrum(self) -> Spectrum:
        """Of ``quick``: the window of ``shown`` flattens a hand's changes at 3 Hz by two fifths."""
        known = self.estimate.speed_mm_s if self.estimate else None
        return spectrum_of(self.quick, known or self.usual_mm_s)

    @cached_property
    def shown(self) -> Shown:
        return shown_speed(
            self.t_s, self.xy_mm, self.run.radius_mm, self.estimate.speed_mm_s if self.estimate else None
        )


def gather(session: Session, estimates: Estimates = ()) -> tuple[RunData, ...]:
    """Runs with enough usable edges, without chatter; steady ones without outliers.

    estimates: by ``searched``, of the runs of which they are known.
    """
    known = {id(run) for run, _ in estimates}
    others = searched(replace(session, runs=tuple(run for run in session.runs if id(run) not in known)))
    found = {id(run): estimate for run, estimate in (*estimates, *others)}
    out = []
    for run in session.runs:
        try:
            ready = prepare(run, session.stylus.diameter_mm)
        except EstimateError:
            continue
        edges, estimate = ready.edges, None
        if edges.t_s.size < FEWEST_EDGES:
            continue
        if has_constant_speed(run):
            estimate = found[id(run)]
            if estimate.latency_s is None or estimate.alignment is None:
                continue
            keep = np.isin(edges.t_s, estimate.alignment.edge_t_s)
            edges = edges.take(keep)
        if edges.t_s.size < FEWEST_EDGES:
            continue
        t_s, xy_mm = averaged(ready.touch.t_s, ready.xy_mm)
        widths = _widths(run, t_s, xy_mm, edges.t_s, estimate)
        if widths is None:
            continue
        half_s, wide_s, noise_mm = widths
        guess_s = np.full(edges.t_s.size, _guess_s(estimate))
        out.append(
            RunData(
                run,
                t_s,
                xy_mm,
                edges.t_s,
                edges.falling,
                half_s,
                wide_s,
                noise_mm,
                estimate,
                guess_s,
                ready.touch.t_s,
            )
        )
    return wide_enough(tuple(out))


def averaged(t_s: FloatArray, xy_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Means (k,), (k, 2) within ``HAND_STEP_S``, not across contact losses."""
    each = round(HAND_STEP_S / sample_interval_s(t_s)) if t_s.size > 2 else 1
    if each < 2:
        return t_s, xy_mm
    piece = np.searchsorted(contact_losses(t_s)[:, 1], t_s, side="right")
    place = np.arange(t_s.size) - np.searchsorted(piece, piece)
    group = np.cumsum(place % each == 0) - 1
    count = np.bincount(group)
    mean = [np.bincount(group, values) / count for values in (t_s, *xy_mm.T)]
    return mean[0], np.column_stack(mean[1:])


def _guess_s(estimate: RunEstimate | None) -> float:
    return GUESS_S if estimate is None or estimate.latency_s is None else estimate.latency_s


def _widths(
    run: Run, t_s: FloatArray, xy_mm: FloatArray, edge_t_s: FloatArray, estimate: RunEstimate | None
) -> tuple[float, FloatArray, float] | None:
    """Half windows of positions and of speeds (m,), noise; None if that is unknown."""
    guess_s, dt_s = _guess_s(estimate), sample_interval_s(t_s)
    half_s, noise_mm = best_half_width_s(t_s, xy_mm[:, 1:], edge_t_s + guess_s)
    if not np.isfinite(noise_mm):
        return None
    if estimate is None:
        half_s = min(half_s, max(0.05, 4.5 * dt_s))
    elif run.radius_mm and estimate.speed_mm_s:
        half_s = min(half_s, _on_a_circle_s(run.radius_mm, estimate.speed_mm_s, dt_s))
    return half_s, speed_half_widths_s(t_s, xy_mm, edge_t_s + guess_s, noise_mm), noise_mm


def _on_a_circle_s(radius_mm: float, speed_mm_s: float, dt_s: float) -> float:
    """Half the widest window in which a cubic follows a circle."""
    return max(CUBIC_RAD * radius_mm / speed_mm_s, 4.5 * dt_s)


def as_shown(runs: tuple[RunData, ...]) -> tuple[RunData, ...]:
    """Runs as the panel showed them."""
    return tuple(data.as_shown or data for data in runs)


def before_events(runs: tuple[RunData, ...]) -> tuple[RunData, ...]:
    """Runs with only effects on events undone."""
    return undone(runs, [effect for effect in runs[0].undone if effect.of_events]) if runs else runs


def undone(runs: tuple[RunData, ...], effects: Sequence[Undoing]) -> tuple[RunData, ...]:
    """Runs with effects undone in their traces. Raises EstimateError if nothing of a run is left."""
    wanted = tuple(sorted(effects, key=lambda effect: effect.place))
    if not runs or wanted == runs[0].undone:
        return runs
    raw = as_shown(runs)
    if not wanted:
        return raw
    first_s = min(float(data.t_s[0]) for data in raw)
    return wide_enough(tuple(_undone(data, wanted, first_s) for data in raw))


def _undone(data: RunData, effects: tuple[Undoing, ...], first_s: float) -> RunData:
    trace = UndoneTrace(data.t_s, data.xy_mm, data.noise_mm)
    for effect in effects:
        trace = effect.undo(trace, data, first_s)
    widths = _widths(data.run, trace.t_s, trace.xy_mm, data.edge_t_s, data.estimate) if trace.t_s.size else None
    if widths is None or not np.isfinite(trace.noise_mm):
        raise EstimateError(
            message("{run}: its trace cannot be freed of a ripple or a low-pass", run=data.run.id), "Leave the run out"
        )
    half_s, wide_s, _ = widths
    return replace(
        data,
        t_s=trace.t_s,
        xy_mm=trace.xy_mm,
        half_s=half_s,
        speed_half_s=wide_s,
        noise_mm=trace.noise_mm,
        undone=effects,
        spread=trace.spread,
        as_shown=data,
    )
