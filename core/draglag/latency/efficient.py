"""Joint maximum likelihood of a run's latency, slope and intercepts."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from draglag.instruments.beam import Lines, sides, stylus_diameter_mm
from draglag.latency.arrival import Arrival, set_back
from draglag.latency.common import common_flags, cost_without_shift
from draglag.latency.edges import Edges
from draglag.latency.estimate import FEWEST_EDGES, Alignment, Prepared, RunEstimate
from draglag.latency.path import INDEPENDENT_S
from draglag.latency.pauses import NONE, Pauses, without_pauses
from draglag.latency.scan import Scan, scan
from draglag.latency.track import Track, track_of
from draglag.latency.weighing import Known, known_fit, likely_scatter_mm, outliers, weighted_fit
from draglag.numerics import student_t
from draglag.path.events import in_contact
from draglag.recording import FloatArray

# nats. A rejected edge may lie anywhere on the screen (300 mm) and is one in a hundred: ln(300 / √(2π) · 100). Physical
REJECTED = 9.4
# Smoothing spreads the start of a movement into its first edges, by less than NEAR_MM: one in ten of a short run, which
# costs as many nats, ln(2 · 10). Physical
NEAR_MM, NEARLY = 1.0, 3.0
NEAR_ENOUGH = 0.1  # of the stylus' width (RMS): between two points of the search's grid a parabola knows no better
ALIAS_LOG_POSTERIOR = 4.0  # a rival minimum closer than this cannot be ruled out
NO_BETTER = 0.1  # nats per edge: how a path is smoothed changes the scatter of its edges by a tenth. Derived
# Standard deviation of latencies of drags that are fast enough to fit again half a turn of their circle later: screens
# show them 20 to 200 ms late. It chooses among minima only. Physical (the paper).
USUAL_S = 0.1
SCATTER_LASTS_S = 0.03
CONVERGED_S = 3e-5  # smaller steps are far below any interval
SCATTER_CERTAIN = 0.2  # nothing calls for another explanation of the edges
GRAZING = 0.15  # below this fraction of the speed across the beam, the side of an edge is a guess
LARGEST_SE_RATIO = 3.0  # a place this many times less sure than the median is none


@dataclass(frozen=True)
class Solution:
    """A converged fit. parameters: L (s), slope, middle (mm), half width (mm), dL/dln v (s).

    ``reached_s``: edges within the trace; ``near_s``: those of them that are rejected though near it; ``tau_mm``:
    scatter of single edges beyond the known; ``p_no_scatter``: probability of none.
    """

    latency_s: float
    parameters: FloatArray
    covariance: FloatArray
    edges: Edges
    reached_s: FloatArray
    near_s: FloatArray
    xy_mm: FloatArray
    v_mm_s: FloatArray
    side: FloatArray
    residual_mm: FloatArray
    log_likelihood: float
    tau_mm: float
    p_no_scatter: float
    n_outside: int
    track: Track

    @property
    def log_likelihood_per_edge(self) -> float:
        """Of all edges that the trace reaches there, the rejected included: those beyond its ends say nothing."""
        return self.log_likelihood_on(self.reached_s) / max(self.reached_s.size, 1)

    def log_likelihood_on(self, edge_t_s: FloatArray) -> float:
        """Of some of these edges."""
        used, near = (int(np.count_nonzero(np.isin(edge_t_s, of))) for of in (self.edges.t_s, self.near_s))
        far = edge_t_s.size - used - near
        return used * self.log_likelihood / self.edges.t_s.size - NEARLY * near - REJECTED * far

    @property
    def se_s(self) -> float:
        variance_s2 = float(self.covariance[0, 0])
        return float(np.sqrt(variance_s2)) if variance_s2 >= 0 else np.inf  # negative by rounding: nothing is known

    @property
    def dof(self) -> int:
        return int(self.edges.t_s.size) - 4

    @property
    def speed_mm_s(self) -> FloatArray:
        return np.hypot(self.v_mm_s[:, 0], self.v_mm_s[:, 1])


def estimate_efficient(ready: Prepared, blank: RunEstimate, window_s: tuple[float, float]) -> RunEstimate:
    """The latency of a run by joint maximum likelihood."""
    ready, arrival, smoothed = set_back(ready)
    track = track_of(ready, smoothed)
    coarse = scan(ready.touch, ready.edges, window_s, ready.stylus_diameter_mm, track.path, track.losses_s)
    minima = coarse.minima()
    if not minima:
        return replace(blank, flags=("unidentifiable",))
    solutions = [
        solution
        for k in _worth_refining(coarse, minima, NEAR_ENOUGH * ready.stylus_diameter_mm)
        if (solution := _solved(ready, float(coarse.latency_s[k]), track)) is not None
    ]
    if not solutions:
        return replace(blank, flags=("unidentifiable",))
    best = _likeliest(solutions)
    if track.tremor is not None and best.p_no_scatter < SCATTER_CERTAIN:
        # Where a steep law re-times the trace, apparent tremor is not movement of the stylus: the edges decide.
        plain = _on_track(best, replace(track, with_tremor=False))
        if plain.log_likelihood > best.log_likelihood:
            best = plain
    best, pauses = _without_pauses(ready, best)
    extra = []
    if any(_rivals(best, other) for other in solutions):
        extra += ["alias", "unidentifiable"]
    if best.n_outside > 0.1 * (best.n_outside + best.edges.t_s.size):
        extra.append("lost_contact")
    if best.tau_mm > 3 * track.path.noise_mm:
        extra.append("excess_scatter")
    return common_flags(_describe(ready, blank, best, arrival, pauses), ready, best.edges, window_s, tuple(extra))


def _likeliest(solutions: list[Solution]) -> Solution:
    best = max(solutions, key=lambda one: one.log_likelihood_per_edge)
    for other in solutions:
        if _log_odds(best, other) < 0:
            best = other
    return best


def _log_odds(one: Solution, other: Solution) -> float:
    """Nats by which one latency is more probable than another, on the edges that the trace reaches at both."""
    both = np.intersect1d(one.reached_s, other.reached_s)
    n = both.size
    better = one.log_likelihood_on(both) - other.log_likelihood_on(both)
    surely = np.sign(better) * max(abs(better) - NO_BETTER * n, 0.0)
    return float(surely - 0.5 * (one.latency_s**2 - other.latency_s**2) / USUAL_S**2)


def _rivals(best: Solution, other: Solution) -> bool:
    """Whether neither can be ruled out."""
    return abs(other.latency_s - best.latency_s) > 0.01 and _log_odds(best, other) < ALIAS_LOG_POSTERIOR


def _without_pauses(ready: Prepared, best: Solution) -> tuple[Solution, Pauses]:
    others, pauses = without_pauses(ready, best.track, best.latency_s, best.parameters[1:4])
    without = _solved(others, best.latency_s, best.track) if pauses.t_s.size else None
    return (best, NONE) if without is None else (without, pauses)


def _worth_refining(coarse: Scan, minima: list[int], near_mm: float) -> list[int]:
    """Minima that may be the best: how near one lies to a point of the grid says nothing."""
    each = {k: coarse.between(k) for k in minima}
    return [k for k in minima if each[k] <= 6 * min(each.values()) + near_mm**2]


def _solved(ready: Prepared, latency_s: float, track: Track) -> Solution | None:
    try:
        return solve(ready, latency_s, track)
    except np.linalg.LinAlgError:
        return None


def solve(ready: Prepared, latency_s: float, track: Track) -> Solution | None:
    """Gauss–Newton from a starting latency; None with too few edges or on divergence."""
    total = ready.edges.t_s.size
    edges = _placed(ready, latency_s, track)
    n_lost, reached_s = total - edges.t_s.size, edges.t_s
    start_s, slope = latency_s, 0.0
    known: Known | None = None
    residual: FloatArray | None = None
    for step in range(10):
        if edges.t_s.size < FEWEST_EDGES:
            return None
        at_s = edges.t_s + latency_s
        xy_mm, v_mm_s = track.with_velocity(at_s)
        across = v_mm_s[:, 1] - slope * v_mm_s[:, 0]
        speed = np.hypot(v_mm_s[:, 0], v_mm_s[:, 1])
        keep = np.abs(across) > GRAZING * speed
        if not keep.all():
            # An edge that cannot be placed is dropped; one that no stylus made is rejected further down.
            n_lost += int(np.count_nonzero(~keep))
            reached_s = reached_s[~np.isin(reached_s, edges.t_s[~keep])]
            edges, known, residual = Edges(edges.t_s[keep], edges.falling[keep], edges.n_rejected), None, None
            continue
        if known is None:
            known = _known(edges.t_s, at_s, track)
        side = sides(edges.falling, across)
        design = _design(track, at_s, slope, side, xy_mm, v_mm_s)
        change, residual = known_fit(design, xy_mm[:, 1], known)
        slope, linearised_s = float(change[1]), latency_s
        latency_s += float(np.clip(change[0], -0.03, 0.03))
        if abs(latency_s - start_s) > 0.06:
            return None
        outlier = outliers(residual, known.variance)
        if step >= 1 and outlier.any() and edges.t_s.size - np.count_nonzero(outlier) >= FEWEST_EDGES:
            edges, known, residual = edges.take(~outlier), None, None
            continue
        if abs(change[0]) < CONVERGED_S and step >= 1:
            break
    if residual is None or known is None:
        return None
    fit = weighted_fit(design, xy_mm[:, 1], known, likely_scatter_mm(residual))
    latency_s = linearised_s + float(np.clip(fit.estimate[0], -0.03, 0.03))
    parameters = fit.estimate.copy()
    parameters[0] = latency_s
    return Solution(
        latency_s=latency_s,
        parameters=parameters,
        covariance=fit.spread,
        edges=edges,
        reached_s=reached_s,
        near_s=_near_s(ready, edges, reached_s, parameters, track),
        xy_mm=xy_mm,
        v_mm_s=v_mm_s,
        side=side,
        residual_mm=fit.residual,
        log_likelihood=fit.log_likelihood,
        tau_mm=fit.tau_mm,
        p_no_scatter=fit.p_no_scatter,
        n_outside=n_lost,
        track=track,
    )


def _near_s(ready: Prepared, used: Edges, reached_s: FloatArray, parameters: FloatArray, track: Track) -> FloatArray:
    """Times of rejected edges that lie near the trace."""
    which = np.isin(ready.edges.t_s, reached_s) & ~np.isin(ready.edges.t_s, used.t_s)
    edge_s, at_s = ready.edges.t_s[which], ready.edges.t_s[which] + parameters[0]
    xy_mm, v_mm_s = track.with_velocity(at_s)
    side = sides(ready.edges.falling[which], v_mm_s[:, 1] - parameters[1] * v_mm_s[:, 0])
    off_mm = xy_mm[:, 1] - parameters[1] * xy_mm[:, 0] - parameters[2] - side * parameters[3]
    return np.asarray(edge_s[np.abs(off_mm) < NEAR_MM])


def _on_track(solution: Solution, track: Track) -> Solution:
    at_s = solution.edges.t_s + solution.latency_s
    xy_mm = track.at(at_s)
    design = _design(track, at_s, float(solution.parameters[1]), solution.side, xy_mm, solution.v_mm_s)
    known = _known(solution.edges.t_s, at_s, track)
    _, residual = known_fit(design, xy_mm[:, 1], known)
    fit = weighted_fit(design, xy_mm[:, 1], known, likely_scatter_mm(residual))
    latency_s = solution.latency_s + float(np.clip(fit.estimate[0], -0.03, 0.03))
    parameters = fit.estimate.copy()
    parameters[0] = latency_s
    return replace(
        solution,
        latency_s=latency_s,
        parameters=parameters,
        covariance=fit.spread,
        xy_mm=xy_mm,
        residual_mm=fit.residual,
        log_likelihood=fit.log_likelihood,
        tau_mm=fit.tau_mm,
        p_no_scatter=fit.p_no_scatter,
        track=track,
    )


def _placed(ready: Prepared, latency_s: float, track: Track) -> Edges:
    edges = ready.edges
    at_s = edges.t_s + latency_s
    keep = in_contact(ready.touch.t_s, at_s, track.losses_s)
    keep &= (at_s > track.span_s[0] + 2 * ready.dt_s) & (at_s < track.span_s[1] - 2 * ready.dt_s)
    return Edges(edges.t_s[keep], edges.falling[keep], edges.n_rejected)


def _design(
    track: Track, at_s: FloatArray, slope: float, side: FloatArray, xy_mm: FloatArray, v_mm_s: FloatArray
) -> FloatArray:
    """Columns of y = slope · x + middle + side · half − across · δL, and of dL/dln v."""
    across = v_mm_s[:, 1] - slope * v_mm_s[:, 0]
    speed = np.hypot(v_mm_s[:, 0], v_mm_s[:, 1])
    ahead = track.uneven.at(at_s)
    relative = np.clip(np.log(np.maximum(speed, 1e-3) / track.usual_mm_s), -1, 1)
    uneven = ahead[:, 1] - slope * ahead[:, 0] - float(relative.mean()) * across
    return np.column_stack([-across, xy_mm[:, 0], np.ones_like(across), side, -uneven])


def _known(edge_t_s: FloatArray, at_s: FloatArray, track: Track) -> Known:
    """Covariance of the edges; both edges of a fast crossing share unexplained scatter."""
    m = edge_t_s.size
    reach = int(np.max(np.searchsorted(edge_t_s, edge_t_s + INDEPENDENT_S) - np.arange(m)))
    row = np.arange(reach)[:, None] + np.arange(m)[None, :]
    inside = row < m
    row = np.minimum(row, m - 1)
    lag_s = np.where(inside, edge_t_s[row] - edge_t_s, np.inf)
    scale = track.mean_path.excess_error(at_s, track.edges_of_trace_s)
    bands = track.mean_path.by_lag(lag_s) * scale[row] * scale
    if track.tremor is not None:
        bands += track.tremor.by_lag(lag_s, track.with_tremor)
    bands[0] += 1e-3 * bands[0].mean() + 1e-9
    extra = np.exp(-0.5 * (lag_s / SCATTER_LASTS_S) ** 2)
    extra[0] += 0.02
    return Known(np.asfortranarray(bands), np.asfortranarray(extra))  # as LAPACK wants them


def _describe(ready: Prepared, blank: RunEstimate, best: Solution, arrival: Arrival, pauses: Pauses) -> RunEstimate:
    alignment, n = _alignment(ready, best), best.edges.t_s.size
    speed = np.append(best.speed_mm_s, pauses.speed_mm_s)
    ahead_s, spread_s = _by_tremor_s(best)
    outside_s = best.latency_s + ahead_s
    shown_s = np.append(best.edges.t_s + best.latency_s, pauses.t_s + pauses.latency_s)
    late_s, late_se_s, by_chance_s = arrival.at_edges(shown_s)
    latency_s, se_s = pauses.mixed(outside_s, float(np.hypot(best.se_s, spread_s)), n)
    by_pauses_s = latency_s - outside_s
    latency_s, se_s = latency_s + late_s, float(np.hypot(se_s, late_se_s))
    reach = student_t(max(min(best.dof, best.track.path.noise_dof), 1.0), 0.975) * se_s
    x_mm = alignment.x_mm
    # Noise across the motion adds half its variance over the speed, which is taken off again. Tremor, which the path
    # averages away, adds as much; and an edge is the likelier the faster the stylus crosses.
    noise2, tremor2 = best.track.path.speed_variance, 0.0 if best.track.tremor is None else best.track.tremor.speed2
    mean = max(float(np.mean(speed + (3 * tremor2 - noise2) / (2 * np.maximum(speed, 10.0)))), 0.0)
    return replace(
        blank,
        n_edges=speed.size,
        n_rejected=best.edges.n_rejected,
        speed_mm_s=mean,
        # Edges of one crossing share their windows: half as many independent speeds as edges.
        speed_se_mm_s=float(np.sqrt(2 * noise2 / speed.size)),
        speed_sd_mm_s=float(np.sqrt(max(float(np.var(speed)) - noise2, 0.0) + tremor2)),
        latency_s=latency_s,
        latency_se_s=se_s,
        se_at_speed_s=float(np.linalg.norm([best.se_s, late_se_s, by_chance_s, by_pauses_s])),
        latency_ci95_s=(latency_s - reach, latency_s + reach),
        j0_per_edge_mm2=cost_without_shift(ready, best.edges, best.track.path.at(best.edges.t_s, 1)[:, 1]),
        j_per_edge_mm2=float(np.mean(best.residual_mm**2)),
        stylus_diameter_mm=stylus_diameter_mm(alignment.lines, float(x_mm.min()), float(x_mm.max())),
        stylus_diameter_se_mm=2 * float(np.sqrt(max(best.covariance[3, 3], 0.0))),
        alignment=alignment,
    )


def _alignment(ready: Prepared, best: Solution) -> Alignment:
    slope, middle, half_mm = (float(value) for value in best.parameters[1:4])
    touch = ready.touch
    raw = [np.interp(best.edges.t_s, touch.t_s, v) for v in (touch.x_mm, touch.y_mm)]
    return Alignment(
        edge_t_s=best.edges.t_s,
        x_raw_mm=raw[0],
        y_raw_mm=raw[1],
        x_mm=best.xy_mm[:, 0],
        y_mm=best.xy_mm[:, 1],
        side=best.side,
        falling=best.edges.falling,
        residual_mm=best.residual_mm,
        latency_s=np.full(best.edges.t_s.size, best.latency_s),
        speed_mm_s=best.speed_mm_s,
        v_mm_s=best.v_mm_s,
        lines=Lines(slope, slope, middle - half_mm, middle + half_mm),
    )


def _by_tremor_s(best: Solution) -> tuple[float, float]:
    """Advance of the trace by tremor, and the scatter of the edges' mean latency by it.

    x(t − L(v + ν)) has the mean −L'·ν², an advance −L'·⟨ν²⟩ / v.
    """
    if best.track.tremor is None:
        return 0.0, 0.0
    speed = max(float(best.speed_mm_s.mean()), 1.0)
    slope_s, tremor = float(best.parameters[4]), best.track.tremor
    ahead = best.v_mm_s / np.maximum(best.speed_mm_s, 1e-6)[:, None]
    left_mm_s = float(np.sqrt(tremor.mean_speed2(best.edges.t_s, ahead)))
    return -slope_s * tremor.speed2 / speed**2, abs(slope_s) * left_mm_s / speed
