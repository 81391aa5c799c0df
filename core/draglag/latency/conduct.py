"""Flags of how a run went."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from draglag.latency.estimate import RunEstimate
from draglag.latency.half_turns import decided_by_others
from draglag.latency.run import estimate_run
from draglag.latency.steady import CHANGED, SPREAD, has_constant_speed, listed, spread_in_trace
from draglag.messages import message
from draglag.recording import FloatArray, Run, Session

# Source of the entry in a run's log that says that the recording program, or its computer, stood still.
STANDSTILL = "standstill"
# Source of the entry that says that the run was one to practise with.
PRACTICE = "practice"
# Share of the passes the touch trace shows of which the laser reported both edges; less is "most of it is missing".
FEWEST_PASSES = 0.5
# Measured over nominal speed. People fall behind fast targets by a fifth; a run that is half or twice as fast as
# asked was another movement.
NOTICEABLY, FAR = 1.25, 2.0
Estimates = tuple[tuple[Run, RunEstimate], ...]
UNEVEN_TRACE = "uneven_trace"
EXCLUDED = (
    "aborted", "device_lost", "failed", PRACTICE, STANDSTILL, "laser_missing", "far_from_nominal", "speed_changed",
    UNEVEN_TRACE
)  # fmt: skip


def with_conduct(estimate: RunEstimate, run: Run) -> RunEstimate:
    """The estimate with these flags put first."""
    flags = _outcome(run)
    if _uneven_trace(estimate, run):  # nor is its speed the stylus' own
        return replace(estimate, flags=tuple(dict.fromkeys((*flags, UNEVEN_TRACE, *estimate.flags))))
    share = _observed_passes(estimate, run)
    if share is not None and share < FEWEST_PASSES:
        flags.append("laser_missing")
    if estimate.speed_mm_s and run.nominal_speed_mm_s:
        off = _ratio(estimate.speed_mm_s, run.nominal_speed_mm_s)
        flags += ["far_from_nominal"] if off > FAR else ["off_speed"] if off > NOTICEABLY else []
    if _halves(estimate) > CHANGED:
        flags.append("speed_changed")
    return replace(estimate, flags=tuple(dict.fromkeys((*flags, *estimate.flags))))


def excluded_because(estimate: RunEstimate) -> str:
    """The excluding flags in words; empty if none."""
    return ", ".join(_in_words(flag) for flag in estimate.flags if flag in EXCLUDED)


def _in_words(flag: str) -> str:
    return flag.replace("_", " ")


def gives_point(estimate: RunEstimate) -> bool:
    """Whether the curve can use the latency: it has a finite standard error and lies inside the searched window."""
    return bool(
        estimate.latency_s is not None
        and estimate.curve_se_s
        and np.isfinite(estimate.curve_se_s)
        and "at_window_end" not in estimate.flags
    )


def is_usable(estimate: RunEstimate) -> bool:
    """Whether the run's latency goes into the curve."""
    return gives_point(estimate) and not excluded_because(estimate)


def why_excluded(
    runs: Iterable[Run], estimates: Iterable[RunEstimate], include: Collection[str] = ()
) -> dict[str, str]:
    """Run id → reason, for runs left out of curve, validation and gap.

    ``estimates``: with the flags of ``with_conduct``; ``include``: ids of runs to keep, or ``all``.
    """
    if "all" in include:
        return {}
    found = {estimate.id: excluded_because(estimate) for estimate in estimates}
    for run in runs:
        for flag in _outcome(run):
            found.setdefault(run.id, flag.replace("_", " "))
    return {run_id: why for run_id, why in found.items() if why and run_id not in include}


def left_out_as_uneven(runs: Iterable[Run], excluded: Mapping[str, str]) -> list[str]:
    """Words on free drags without a latency of their own for want of an even speed; none without.

    ``excluded``: of ``why_excluded``.
    """
    uneven = [
        run.id
        for run in runs
        if run.protocol == "free"
        and (not has_constant_speed(run) or _in_words(UNEVEN_TRACE) in excluded.get(run.id, "").split(", "))
    ]
    if not uneven:
        return []
    return [
        message(
            "1 free drag is left out ({runs}), its speed or its touch trace is uneven at the beam: cross it at an "
            "even speed, and turn far from it"
            if len(uneven) == 1
            else "{n} free drags are left out ({runs}), their speed or their touch trace is uneven at the beam: cross "
            "it at an even speed, and turn far from it",
            n=len(uneven),
            runs=listed(uneven),
        )
    ]


def recorded_again(runs: Sequence[Run], estimates: Iterable[RunEstimate], excluded: Collection[str]) -> dict[str, str]:
    """Run → the first repeat that gave what it did not: a run without a latency, or in ``excluded``.

    ``run-03-2`` and ``run-03-3`` repeat ``run-03``.
    """
    lost = {*excluded, *(estimate.id for estimate in estimates if estimate.latency_s is None)}
    ids = {run.id for run in runs}
    found: dict[str, str] = {}
    waiting: dict[str, list[str]] = {}
    for run in runs:
        head, _, attempt = run.id.rpartition("-")
        planned = head if head in ids and attempt.isdecimal() else run.id
        if run.id in lost:
            waiting.setdefault(planned, []).append(run.id)
        else:
            found |= dict.fromkeys(waiting.pop(planned, ()), run.id)
    return found


def estimated(session: Session) -> Estimates:
    """Estimates of the runs at constant speed."""
    steady = [run for run in session.runs if has_constant_speed(run)]
    width_mm = session.stylus.diameter_mm
    found = [estimate_run(run, width_mm) for run in steady]
    found = decided_by_others(steady, found, lambda run, window_s: estimate_run(run, width_mm, window_s=window_s))
    return tuple(zip(steady, found, strict=True))


def kept_runs(
    session: Session, include: Collection[str] = (), estimates: Estimates | None = None
) -> tuple[Session, dict[str, str], Estimates]:
    """The session without the runs to leave out; run id → reason; the runs' estimates, made where none are given."""
    if estimates is None:
        estimates = estimated(session)
    excluded = why_excluded(session.runs, (with_conduct(one, run) for run, one in estimates), include)
    if excluded:
        session = replace(session, runs=tuple(run for run in session.runs if run.id not in excluded))
    return session, excluded, estimates


def _outcome(run: Run) -> list[str]:
    flags = [] if run.outcome == "complete" else [run.outcome]
    sources = {entry.source for entry in run.log}
    return flags + [one for one in (PRACTICE, STANDSTILL) if one in sources]


def _ratio(one: float, other: float) -> float:
    return max(one, other) / max(min(one, other), 1e-9)


def _halves(estimate: RunEstimate) -> float:
    if estimate.alignment is None or estimate.alignment.edge_t_s.size < 8:
        return 1.0
    t_s, speed = estimate.alignment.edge_t_s, estimate.alignment.speed_mm_s
    early = t_s < 0.5 * (t_s[0] + t_s[-1])
    if not early.any() or early.all():
        return 1.0
    return _ratio(float(speed[early].mean()), float(speed[~early].mean()))


def _uneven_trace(estimate: RunEstimate, run: Run) -> bool:
    """Whether a free drag is even by the light alone, and not in its trace at its own latency either: where latency
    falls steeply with speed, a trace stands while the stylus turns and leaps after it, past edges that are near."""
    if run.protocol != "free" or estimate.alignment is None or spread_in_trace(run) <= SPREAD:
        return False
    speed = estimate.alignment.speed_mm_s
    return float(speed.std()) > SPREAD * float(speed.mean())


def _observed_passes(estimate: RunEstimate, run: Run) -> float | None:
    if estimate.alignment is None or not run.laser.t_s.size:
        return None
    lines = estimate.alignment.lines
    middle = 0.5 * (lines.intercept_top_mm + lines.intercept_bottom_mm)
    half_mm = 0.5 * abs(lines.intercept_bottom_mm - lines.intercept_top_mm)
    passes = _crossings(run.touch.y_mm - lines.slope_top * run.touch.x_mm - middle, half_mm)
    return run.laser.t_s.size / (2 * passes) if passes else None


def _crossings(off_mm: FloatArray, half_mm: float) -> int:
    """How often a trace crosses a strip; grazes do not count."""
    clear = off_mm[np.isfinite(off_mm) & (np.abs(off_mm) > half_mm)]
    return int(np.count_nonzero(np.diff(np.sign(clear))))
