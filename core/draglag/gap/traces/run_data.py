"""The runs of a session ready for the joint fit: their edges, their traces, and how widely those are smoothed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from scipy.sparse import csr_matrix, identity

from draglag.errors import EstimateError
from draglag.events import contact_losses, sample_interval_s
from draglag.gap.streams.lattice import Lattice, lattice_of
from draglag.gap.traces.lateness import without_lateness
from draglag.gap.traces.steep import wide_enough
from draglag.gap.traces.unwarped import Shown, shown_speed
from draglag.latency.estimate import RunEstimate, estimate_run, prepare
from draglag.motion import best_half_width_s, local_fit, speed_half_widths_s
from draglag.recording import FloatArray, Run, Session

FEWEST = 6  # edges a run must give to count
GUESS_S = 0.06
QUICK_S = 0.004  # no speed changes within less, whatever the panel's rate


@dataclass(frozen=True, eq=False)
class RunData:
    """One run ready for the joint fit. half_s: width of the position fits; noise_mm: one event's position noise.

    lattice, lag_s, switched: what was undone in the trace, an electrodes' ripple, a low-pass's time constant and a
    second filter's lateness with its times; as_shown: the run before that. spread: (n, events shown) by how much each
    event shown, noise and all, then moves each of the n.
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
    lag_s: float = 0.0
    even: bool = False
    switched: tuple[float, ...] = ()
    spread: csr_matrix | None = None
    as_shown: RunData | None = None

    @property
    def steady(self) -> bool:
        return self.estimate is not None

    @property
    def keeps_moving(self) -> bool:
        """Whether its speed is that of a hand which follows on; after a rest, a panel catches up in its own way."""
        return self.steady or self.run.protocol in ("chirp", "multisine")

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
    def quick(self) -> tuple[FloatArray, FloatArray]:
        """Times (g,) s, evenly spaced, and the speed that the trace shows there, as quick as it can be told."""
        step_s = max(sample_interval_s(self.t_s), QUICK_S)
        grid_s = np.arange(self.t_s[0], self.t_s[-1], step_s)
        fit = local_fit(self.t_s, self.xy_mm, grid_s, float(np.median(self.speed_half_s)))
        return grid_s, np.interp(grid_s, grid_s[fit.ok], fit.speed_mm_s[fit.ok])

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
    return tuple(data.as_shown or data for data in runs)


def undone(
    runs: tuple[RunData, ...], ripple: bool, lag_s: float, even: bool = False, switched: tuple[float, ...] = ()
) -> tuple[RunData, ...]:
    """The runs with the lattice undone that their traces show, if any, a low-pass of time constant ``lag_s``, and a
    second filter's lateness, s, in the stretches of session time from–to that follow it in ``switched``.

    Raises EstimateError where nothing of a run is left: the model would take for undone what is not.
    """
    if not runs:
        return runs
    raw = as_shown(runs)
    lattice = (runs[0].lattice or lattice_in(raw)) if ripple else None
    if lattice is runs[0].lattice and (lag_s, even, switched) == (runs[0].lag_s, runs[0].even, runs[0].switched):
        return runs
    if lattice is None and lag_s == 0 and not switched:
        return raw
    out = []
    first_s = min(float(data.t_s[0]) for data in raw)
    for data in raw:
        t_s, xy_mm, spread = data.t_s, data.xy_mm, None
        noise_mm = data.noise_mm
        if switched:
            t_s, xy_mm = without_lateness(t_s, xy_mm, switched[0], first_s + np.array(switched[1:]))
        if lattice is not None:
            xy_mm = lattice.undone_mm(xy_mm)
            noise_mm = best_half_width_s(t_s, xy_mm[:, 1:], data.edge_t_s + _guess_s(data.estimate))[1]
        if lag_s:
            t_s, xy_mm, spread = _sharpened(t_s, xy_mm, lag_s, float(np.median(data.speed_half_s)), even)
        widths = _widths(data.run, t_s, xy_mm, data.edge_t_s, data.estimate) if t_s.size else None
        if widths is None or not np.isfinite(noise_mm):
            raise EstimateError(
                f"{data.run.id}: its trace cannot be freed of a ripple or a low-pass", "Leave the run out"
            )
        half_s, wide_s, _ = widths
        out.append(
            replace(
                data,
                t_s=t_s,
                xy_mm=xy_mm,
                half_s=half_s,
                speed_half_s=wide_s,
                noise_mm=noise_mm,
                lattice=lattice,
                lag_s=lag_s,
                even=even,
                switched=switched,
                spread=spread,
                as_shown=data,
            )
        )
    return wide_enough(tuple(out))


@lru_cache(maxsize=1)
def lattice_in(runs: tuple[RunData, ...]) -> Lattice | None:
    """The same for the same runs, whichever model is tried on them."""
    return lattice_of([(data.t_s, data.xy_mm) for data in runs])


def _sharpened(
    t_s: FloatArray, xy_mm: FloatArray, lag_s: float, half_width_s: float, even: bool
) -> tuple[FloatArray, FloatArray, csr_matrix]:
    """A trace before a low-pass whose delay at rest is the law's, and by how much each event (columns) moves each of
    those that are left (rows).

    One of first order that looks back only: u = y + τ ẏ, stamped τ later; an even one, of a phase that only delays, as
    a moving average is: u = y − ½ τ² ÿ.
    """
    fit = local_fit(t_s, xy_mm, t_s, half_width_s)
    moved = -0.5 * lag_s**2 * fit.by_event.acceleration if even else lag_s * fit.by_event.velocity
    at = np.minimum(fit.first[:, None] + np.arange(moved.shape[1]), t_s.size - 1)
    ends = np.arange(0, at.size + 1, at.shape[1])
    added = csr_matrix((moved.ravel(), at.ravel(), ends), shape=(t_s.size, t_s.size))
    added.sum_duplicates()
    spread = (identity(t_s.size, format="csr") + added)[fit.ok]
    return t_s[fit.ok] + (0.0 if even else lag_s), spread @ xy_mm, spread
