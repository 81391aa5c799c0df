"""The runs of a session ready for the joint fit: their edges, their traces, and how widely those are smoothed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from draglag.errors import EstimateError
from draglag.gap.lattice import Lattice, lattice_of
from draglag.gap.steep import wide_enough
from draglag.gap.unwarped import Shown, shown_speed
from draglag.latency.estimate import RunEstimate, estimate_run, prepare
from draglag.motion import best_half_width_s, contact_losses, local_fit, sample_interval_s, speed_half_widths_s
from draglag.recording import FloatArray, Run, Session

FEWEST = 6  # edges a run must give to count
GUESS_S = 0.06


@dataclass(frozen=True)
class RunData:
    """One run ready for the joint fit. half_s: width of the position fits; noise_mm: one event's position noise.

    lattice: that was undone in xy_mm; rippled: the run as the panel showed it, before that.
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
    lattice: Lattice | None = None
    rippled: RunData | None = None

    @property
    def steady(self) -> bool:
        return self.estimate is not None

    @cached_property
    def losses_s(self) -> FloatArray:
        """Contact losses, (k, 2) first and last time of each."""
        return contact_losses(self.t_s)

    @cached_property
    def smooth_mm(self) -> FloatArray:
        """Positions of the path at its events, (n, 2): where the stylus was, but for what the panel adds to each."""
        fit = local_fit(self.t_s, self.xy_mm, self.t_s, self.half_s)
        return np.where(fit.ok[:, None], fit.xy_mm, self.xy_mm)

    @cached_property
    def shown(self) -> Shown:
        """The speed that the trace shows, evenly spaced."""
        return shown_speed(
            self.t_s, self.xy_mm, self.run.radius_mm, self.estimate.speed_mm_s if self.estimate else None
        )


def gather(session: Session) -> tuple[RunData, ...]:
    """Runs with enough usable edges, de-chattered, outliers of steady runs removed."""
    out = []
    for run in session.runs:
        try:
            ready = prepare(run, session.stylus.diameter_mm)
        except EstimateError:
            continue
        edges, estimate = ready.edges, None
        if edges.t_s.size < FEWEST:
            continue
        if run.protocol in ("circle", "free"):
            estimate = estimate_run(run, session.stylus.diameter_mm, window_s=(-0.15, 0.45))
            if estimate.latency_s is None or estimate.alignment is None:
                continue
            keep = np.isin(edges.t_s, estimate.alignment.edge_t_s)
            edges = edges.take(keep)
        if edges.t_s.size < FEWEST:
            continue
        widths = _widths(run, ready.touch.t_s, ready.xy_mm, edges.t_s, estimate)
        if widths is None:
            continue
        half_s, wide_s, noise_mm = widths
        guess_s = np.full(edges.t_s.size, _guess_s(estimate))
        out.append(
            RunData(
                run,
                ready.touch.t_s,
                ready.xy_mm,
                edges.t_s,
                edges.falling,
                half_s,
                wide_s,
                noise_mm,
                estimate,
                guess_s,
            )
        )
    return wide_enough(tuple(out))


def _guess_s(estimate: RunEstimate | None) -> float:
    return GUESS_S if estimate is None or estimate.latency_s is None else estimate.latency_s


def _widths(
    run: Run, t_s: FloatArray, xy_mm: FloatArray, edge_t_s: FloatArray, estimate: RunEstimate | None
) -> tuple[float, FloatArray, float] | None:
    """Half-widths of the fits of position, s, and of speed, (m,) s, and one event's noise, mm; None without noise."""
    guess_s, dt_s = _guess_s(estimate), sample_interval_s(t_s)
    half_s, noise_mm = best_half_width_s(t_s, xy_mm[:, 1:], edge_t_s + guess_s)
    if not np.isfinite(noise_mm):
        return None
    if estimate is None:
        half_s = min(half_s, max(0.05, 4.5 * dt_s))
    elif run.radius_mm and estimate.speed_mm_s:
        # A cubic over ω h = 0.85 rad of a circle is true to 0.2 % of the way off its centre line.
        half_s = min(half_s, max(0.85 * run.radius_mm / estimate.speed_mm_s, 4.5 * dt_s))
    return half_s, speed_half_widths_s(t_s, xy_mm, edge_t_s + guess_s, noise_mm), noise_mm


def as_shown(runs: tuple[RunData, ...]) -> tuple[RunData, ...]:
    """The runs as the panel showed them."""
    return tuple(data.rippled or data for data in runs)


def without_ripple(runs: tuple[RunData, ...]) -> tuple[RunData, ...]:
    """The runs with the lattice undone that their traces show; as they are where none is shown, or undone already."""
    if any(data.lattice is not None for data in runs):
        return runs
    lattice = lattice_of([(data.t_s, data.xy_mm) for data in runs])
    if lattice is None:
        return runs
    out = []
    for data in runs:
        xy_mm = lattice.undone_mm(data.xy_mm)
        widths = _widths(data.run, data.t_s, xy_mm, data.edge_t_s, data.estimate)
        if widths is None:
            return runs
        half_s, wide_s, noise_mm = widths
        flat = RunData(
            data.run,
            data.t_s,
            xy_mm,
            data.edge_t_s,
            data.falling,
            half_s,
            wide_s,
            noise_mm,
            data.estimate,
            data.guess_s,
            lattice,
            data,
        )
        out.append(flat)
    return wide_enough(tuple(out))
