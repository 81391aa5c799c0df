"""A measured session simulated again with the measured hand."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from draglag.errors import EstimateError
from draglag.gap.constants import SEED
from draglag.gap.fitting.joint import Fit, restrict
from draglag.gap.fitting.model import residual_mm
from draglag.gap.fitting.noise import open_levels_s
from draglag.gap.fitting.nuisances import late_by_nuisances_s
from draglag.gap.fitting.signatures import view_of
from draglag.gap.replaying.hand_path import hand_motion
from draglag.gap.replaying.phase import in_phase
from draglag.gap.replaying.realised import effects_of_fit, rig_of
from draglag.gap.results import GapReport
from draglag.gap.streams.evidence import inspect
from draglag.gap.traces.edges import Placed, place
from draglag.gap.traces.run_data import RunData, before_events, gather
from draglag.gap.traces.searched import searched
from draglag.latency.conduct import Estimates
from draglag.latency.estimate import RunEstimate
from draglag.latency.spectrum import events_of
from draglag.messages import joined, message
from draglag.path.events import contact_losses
from draglag.recording import FloatArray, IntArray, Run, Session, TouchTrace
from draglag.simulation.chain import simulate_run
from draglag.simulation.effects import Effect, effect_class
from draglag.simulation.kinematics import Motion
from draglag.simulation.residual import View
from draglag.simulation.rig import Rig
from draglag.system.blas import one_blas_thread

Progress = Callable[[float, str], None]

MATCH_S = 0.15  # a simulated edge farther from the measured one is another crossing. Physical


@dataclass(frozen=True)
class Overlay:
    """Residuals of edges under one model, (m,), and their motion."""

    residual_mm: FloatArray
    run: IntArray
    view: View

    @property
    def late_ms(self) -> FloatArray:
        """Residual as latency, (m,); NaN for slow motion across the beam."""
        slow = np.abs(self.view.v_across) < 1
        return np.asarray(1e3 * self.residual_mm / np.where(slow, np.nan, self.view.v_across))


@dataclass(frozen=True)
class RunReplay:
    """One run's estimates, if any. by_nuisances_s: lateness in the fit that no simulation has, and its error."""

    id: str
    protocol: str
    measured: RunEstimate | None
    simulated: RunEstimate | None
    by_nuisances_s: tuple[float, float] = (0.0, 0.0)

    @property
    def difference_ms(self) -> tuple[float, float, float] | None:
        """Measured speed, mm/s, simulated less measured latency, and its error, ms; None without estimates."""
        a, b = self.measured, self.simulated
        if a is None or b is None or a.latency_s is None or b.latency_s is None or a.speed_mm_s is None:
            return None
        late_s, se_s = self.by_nuisances_s
        error_s = float(np.linalg.norm([a.latency_se_s or np.nan, b.latency_se_s or np.nan, se_s]))
        return a.speed_mm_s, 1e3 * (b.latency_s + late_s - a.latency_s), 1e3 * error_s


@dataclass(frozen=True)
class Replay:
    """A session simulated again.

    run, measured_s, simulated_s, falling, across_mm_s: (m,) edges, host time, NaN where not simulated. shown:
    ``session``, its streams repaired if those of the reference are. between_runs_s: (runs,) in the model.
    """

    effects: tuple[Effect, ...]
    session: Session
    runs: tuple[RunReplay, ...]
    run: IntArray
    measured_s: FloatArray
    simulated_s: FloatArray
    falling: np.ndarray
    across_mm_s: FloatArray
    reference: Fit
    shown: Session
    between_runs_s: FloatArray

    @property
    def measured(self) -> Overlay:
        """Measurement under the reference model."""
        fit = self.reference
        return Overlay(fit.residual_mm, fit.run_index.astype(np.int64), fit.view)

    @cached_property
    def simulated(self) -> Overlay | None:
        """Simulation under the reference model."""
        return _overlay(gather(self.shown), self.reference)

    @property
    def difference_ms(self) -> FloatArray:
        """Simulated less measured edge times, (m,)."""
        return np.asarray(1e3 * (self.simulated_s - self.measured_s))

    @property
    def difference_mm(self) -> FloatArray:
        """``difference_ms`` as a distance across the beam, (m,)."""
        return np.asarray(1e-3 * self.difference_ms * self.across_mm_s)

    @property
    def rms_mm(self) -> float:
        """RMS of ``difference_mm`` over simulated edges."""
        good = self.difference_mm[np.isfinite(self.difference_mm)]
        return float(np.sqrt(np.mean(good**2))) if good.size else float("nan")

    @property
    def rms_ms(self) -> float:
        """``rms_mm`` over the RMS velocity across the beam."""
        good = np.isfinite(self.difference_mm)
        if not good.any():
            return float("nan")
        return float(1e3 * self.rms_mm / np.sqrt(np.mean(self.across_mm_s[good] ** 2)))

    @property
    def rms_ms_ci95(self) -> tuple[float, float]:
        """By bootstrap over runs."""
        return _between_runs(self.run, self.difference_mm, self.across_mm_s)

    def latencies_ms(self) -> list[tuple[str, float, float, float, float, float]]:
        """(run, speed mm/s, measured, its error, simulated, its error), ms."""
        out = []
        for item in self.runs:
            a, b = item.measured, item.simulated
            if a is None or b is None or a.latency_s is None or b.latency_s is None or a.speed_mm_s is None:
                continue
            errors = (1e3 * (a.latency_se_s or np.nan), 1e3 * (b.latency_se_s or np.nan))
            out.append((item.id, a.speed_mm_s, 1e3 * a.latency_s, errors[0], 1e3 * b.latency_s, errors[1]))
        return out

    @property
    def runs_that_agree(self) -> tuple[int, int]:
        """Runs whose latencies agree at 95 %, and all compared."""
        _, difference_ms, error_ms = self.differences_ms()
        return int(np.count_nonzero(np.abs(difference_ms) <= 1.96 * error_ms)), difference_ms.size

    def differences_ms(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Speeds, mm/s, simulated less measured latencies, and their standard errors, ms, (runs with both,) each.

        Without runs that the fit does not judge by: there nothing was said about the law.
        """
        each = ((self.runs[k].difference_ms, self.between_runs_s[k]) for k in np.unique(self.run))
        rows = [(*row, 1e3 * between_s) for row, between_s in each if row is not None]
        speed, difference_ms, error_ms, between_ms = np.array(rows, float).reshape(-1, 4).T
        return speed, difference_ms, np.hypot(error_ms, between_ms)

    def to_dict(self) -> dict[str, object]:
        """Numbers for JSON."""
        low, high = self.rms_ms_ci95
        known = np.isfinite(self.simulated_s)
        return {
            "effects": {effect.id: effect.numbers() for effect in self.effects},
            "edge_rms_mm": self.rms_mm,
            "edge_rms_ms": self.rms_ms,
            "edge_rms_ms_ci95": [low, high],
            "n_edges": int(known.size),
            "runs_that_agree": list(self.runs_that_agree),
            "n_simulated": int(np.count_nonzero(known)),
            "runs": [
                {"run": name, "speed_mm_s": v, "measured_ms": m, "measured_se_ms": ms, "simulated_ms": s,
                 "simulated_se_ms": ss}
                for name, v, m, ms, s, ss in self.latencies_ms()
            ],
        }  # fmt: skip


def replay(
    session: Session,
    fit: Fit,
    named: Mapping[str, Mapping[str, float]] | None = None,
    reference: Fit | None = None,
    progress: Progress | None = None,
    measured: Estimates | None = None,
) -> Replay:
    """Session simulated again with its measured hand.

    named: effect id → parameters, the only source of stream and clock effects; None: the fit's. reference: model of the
    overlays; None: ``fit``. measured: estimates of unrepaired runs, for effects that latencies are estimated with.

    Raises EstimateError if no run can be simulated.
    """
    report_progress = progress or (lambda fraction, text: None)
    effects = effects_of_fit(fit, named)
    again = _simulated_session(session, fit, effects, report_progress)
    if not any(run.laser.t_s.size for run in again.runs):
        raise EstimateError(
            message("{session}: the simulated hand never crosses the beam", session=session.name),
            "Check beam and calibration",
        )
    report_progress(0.85, "estimating the simulated runs")
    # Batches, coarse clocks and the like are repaired before anything is estimated, in the simulation as in the
    # measurement; a loop's delay is estimated in unrepaired streams.
    in_stream = [effect for effect in effects if effect.undone_in == "stream"]
    waiting = any(effect.stamped_late_s() for effect in in_stream)
    as_fitted = [data.run for data in fit.runs]
    again = _in_phase(again, [*as_fitted, *session.runs], fit.runs) if waiting else again
    repaired = inspect(again)[1] if in_stream else again
    repaired = _in_phase(repaired, as_fitted, fit.runs) if waiting else repaired
    unrepaired = bool(in_stream) and all(effect.estimated_with for effect in in_stream)
    before = _by_run(measured) if measured and unrepaired else {data.run.id: data.estimate for data in fit.runs}
    after = _by_run(searched(again if unrepaired else repaired))
    runs = tuple(
        RunReplay(d.run.id, d.run.protocol, before.get(d.run.id), after.get(d.run.id), (late_s, se_s))
        for d, late_s, se_s in zip(fit.runs, *(values.tolist() for values in late_by_nuisances_s(fit)), strict=True)
    )
    measured_s = fit.placed.t_s[fit.use]
    falling = fit.placed.falling[fit.use]
    report_progress(1.0, "done")
    return Replay(
        effects,
        again,
        runs,
        fit.run_index.astype(np.int64),
        measured_s,
        _simulated_edges_s(fit, again, measured_s, falling),
        falling,
        fit.placed.v_mm_s[fit.use, 1],
        reference or fit,
        again if reference is not None and _is_raw(reference, session) else repaired,
        np.hypot(fit.white.components.run_s, open_levels_s(fit.runs, fit.placed, fit.use)),
    )


def _is_raw(fit: Fit, session: Session) -> bool:
    """Whether a fit's traces are those of a session, not repaired ones."""
    touch = {run.id: run.touch for run in session.runs}
    own = [(data.run.touch, touch.get(data.run.id, data.run.touch)) for data in fit.runs]
    return all(
        np.array_equal(getattr(a, name), getattr(b, name), equal_nan=True)
        for a, b in own
        for name in ("t_s", "x_mm", "y_mm")
    )


def _by_run(estimates: Estimates) -> dict[str, RunEstimate | None]:
    return {run.id: estimate for run, estimate in estimates}


def _simulated_session(session: Session, fit: Fit, effects: tuple[Effect, ...], report_progress: Progress) -> Session:
    rig = rig_of(session, fit, effects)
    origin_s = min(data.t_s[0] for data in fit.runs)
    as_measured = {run.id: run for run in session.runs}
    runs = []
    for k, data in enumerate(before_events(fit.runs)):
        report_progress(0.8 * k / len(fit.runs), f"simulating {data.run.id}")
        own = np.interp(data.edge_t_s, *_sorted(fit, k))
        motion, start_s = hand_motion(rig, data, own, effects, origin_s)
        reported_s = _reported_s(as_measured.get(data.run.id, data.run), data, effects)
        runs.append(_simulated(rig, data, reported_s, motion, start_s, effects, origin_s, k))
    name = f"{session.name}, simulated with the measured hand"
    return replace(session, name=name, runs=tuple(runs), beam=rig.beam, taps=None)


@one_blas_thread
def replays(session: Session, report: GapReport, progress: Progress | None = None) -> tuple[Replay, ...]:
    """Replays of the first model, the reference, and after each step.

    Raises EstimateError without a verdict, or if no run can be simulated.
    """
    if report.first is None or report.last is None:
        raise EstimateError(
            message("{session}: there is no model to simulate with", session=report.session),
            joined("; ", report.missing),
        )
    report_progress = progress or (lambda fraction, text: None)
    session = report.judged(session)
    loop = any(effect_class(step.effect).estimated_with for step in report.steps)
    measured = searched(session) if loop else None
    fits = [report.first]
    for step in report.steps:
        fits.append(step.fit or fits[-1])
    fits[-1] = report.last
    out = []
    for k, fit in enumerate(fits):
        named = {s.effect: {name: value for name, (value, _) in s.parameters.items()} for s in report.steps[:k]}

        def part(fraction: float, text: str, k: int = k) -> None:
            report_progress((k + fraction) / len(fits), text)

        out.append(replay(session, fit, named, report.first, part, measured))
    return tuple(out)


def _simulated_edges_s(fit: Fit, again: Session, measured_s: FloatArray, falling: np.ndarray) -> FloatArray:
    """Simulated edge nearest to each measured one of its kind, (m,); NaN where none is."""
    out = np.full(measured_s.size, np.nan)
    for k, run in enumerate(again.runs):
        for falls in (True, False):
            mine = np.flatnonzero((fit.run_index == k) & (falling == falls))
            theirs = run.laser.t_s[run.laser.light == (0 if falls else 1)]
            out[mine] = _nearest(measured_s[mine], np.sort(theirs))
    return out


def _in_phase(again: Session, measured: Sequence[Run], runs: Sequence[RunData]) -> Session:
    """Simulated session whose runs lie where the measured ones lie."""
    half_s = {data.run.id: float(np.median(data.speed_half_s)) for data in runs}
    touch = {run.id: run.touch for run in measured}
    placed = [replace(run, touch=in_phase(run.touch, touch[run.id], half_s[run.id])) for run in again.runs]
    return replace(again, runs=tuple(placed))


def _sorted(fit: Fit, k: int) -> tuple[FloatArray, FloatArray]:
    own = fit.placed.run == k
    order = np.argsort(fit.placed.t_s[own])
    return fit.placed.t_s[own][order], fit.placed.latency_s[own][order]


def _reported_s(run: Run, data: RunData, effects: Sequence[Effect]) -> FloatArray:
    """As stamped if repair only removed events and no loop held them, else as repaired."""
    only_removed = np.isin(data.reported_s, run.touch.t_s).all()
    loop = any(effect.estimated_with for effect in effects)
    return run.touch.t_s if only_removed and not loop else data.reported_s


def _simulated(
    rig: Rig,
    data: RunData,
    reported_s: FloatArray,
    motion: Motion,
    start_s: float,
    effects: Sequence[Effect],
    origin_s: float,
    seed: int,
) -> Run:
    # Stamps are rounded: at the median interval frames would slip past a loop's ticks that they keep step with.
    dt_s = events_of(reported_s, np.zeros((reported_s.size, 2))).dt_s
    own = replace(rig, touch_rate_hz=1 / dt_s, noise_mm=data.noise_mm)
    rng = np.random.default_rng([SEED, seed])
    run = simulate_run(
        own, motion, run_id=data.run.id, planned=None, start_s=start_s, rng=rng, effects=effects,
        session_start_s=origin_s,
    )  # fmt: skip
    touch = run.touch
    in_contact = (touch.t_s >= data.t_s[0]) & (touch.t_s <= data.t_s[-1])
    for begin, end in contact_losses(reported_s):
        in_contact &= (touch.t_s <= begin) | (touch.t_s >= end)
    kept = TouchTrace(
        touch.t_s[in_contact], touch.x_mm[in_contact], touch.y_mm[in_contact], touch.contact_id[in_contact]
    )
    was = data.run
    return replace(
        run, touch=kept, protocol=was.protocol, nominal_speed_mm_s=was.nominal_speed_mm_s, radius_mm=was.radius_mm
    )


def _nearest(at_s: FloatArray, others_s: FloatArray) -> FloatArray:
    """NaN beyond ``MATCH_S``."""
    if not others_s.size:
        return np.full(at_s.size, np.nan)
    right = np.clip(np.searchsorted(others_s, at_s), 1, max(others_s.size - 1, 1))
    pair = np.column_stack([others_s[right - 1], others_s[np.minimum(right, others_s.size - 1)]])
    best = pair[np.arange(at_s.size), np.argmin(np.abs(pair - at_s[:, None]), axis=1)]
    return np.where(np.abs(best - at_s) < MATCH_S, best, np.nan)


def _between_runs(run: IntArray, values: FloatArray, across: FloatArray) -> tuple[float, float]:
    good = np.isfinite(values)
    ids = np.unique(run[good])
    if ids.size < 2:
        return (float("nan"), float("nan"))
    squares = np.array([np.sum(values[good & (run == k)] ** 2) for k in ids])
    levers = np.array([np.sum(across[good & (run == k)] ** 2) for k in ids])
    draws = np.random.default_rng(SEED).integers(0, ids.size, (400, ids.size))
    means = 1e3 * np.sqrt(squares[draws].sum(1) / np.maximum(levers[draws].sum(1), 1e-12))
    low, high = np.quantile(means, [0.025, 0.975])
    return float(low), float(high)


def _overlay(runs: tuple[RunData, ...], reference: Fit) -> Overlay | None:
    """Without the reference's effects."""
    if not runs:
        return None
    placed: Placed = place(runs, reference.law)
    view = view_of(placed, reference.law, reference.geometry, reference.width_mm)
    left = residual_mm(placed, reference.geometry)
    keep = placed.ok & np.isfinite(left)
    return Overlay(left[keep], placed.run[keep].astype(np.int64), restrict(view, keep))
