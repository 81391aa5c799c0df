"""The clock's share in a latency."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from draglag.errors import DataError
from draglag.instruments.clocks import WARN_S, clock_warnings, fit_clocks, remapped_within
from draglag.latency.budget import widened
from draglag.latency.estimate import WINDOW_S, RunEstimate
from draglag.latency.run import estimate_run
from draglag.messages import message
from draglag.recording import ClockBounds, FloatArray, Run, Session, Taps

# Comparisons this long before and after a run still constrain its clock: over longer times no quartz is linear.
NEARBY_S = 120.0
# A run whose own comparisons reach this close to its first and last edge needs no others.
REACH_S = 2.0


def nearby(run: Run, clocks: Sequence[ClockBounds]) -> tuple[ClockBounds, ...]:
    """The session's comparisons around a run: none if its own suffice, all if none is close."""
    own = [part for part in run.sync if part.stream == "laser" and len(part.device_s)]
    if own and len(run.laser.t_s):
        first_s = min(float(part.host_min_s.min()) for part in own) - REACH_S
        last_s = max(float(part.host_max_s.max()) for part in own) + REACH_S
        if first_s <= run.laser.t_s.min() and run.laser.t_s.max() <= last_s:
            return ()
    close = []
    for part in clocks:
        # One side of a comparison may be open.
        seen_s = np.where(np.isfinite(part.host_max_s), part.host_max_s, part.host_min_s)
        here = (seen_s >= run.start_s - NEARBY_S) & (seen_s <= run.start_s + run.duration_s + NEARBY_S)
        if here.any():
            epoch = part.epoch[here] if len(part.epoch) else part.epoch
            close.append(
                ClockBounds(part.stream, part.device_s[here], part.host_min_s[here], part.host_max_s[here], epoch)
            )
    return tuple(close) if close else tuple(clocks)


def estimate_on_clock(
    run: Run,
    clocks: Sequence[ClockBounds],
    stylus_diameter_mm: float,
    estimator: str = "efficient",
    update_rate_hz: float | None = None,
    window_s: tuple[float, float] = WINDOW_S,
) -> RunEstimate:
    """``estimate_run`` with edges on the compared clock, its uncertainty in the interval.

    ``clocks``: comparisons outside the run.
    """
    around = nearby(run, clocks)
    try:
        run, bound_s = remapped_within(run, around)
    except DataError:  # unreadable comparisons constrain nothing
        bound_s = None
    return with_clock(estimate_run(run, stylus_diameter_mm, estimator, update_rate_hz, window_s), bound_s)


def with_clock(estimate: RunEstimate, bound_s: float | None) -> RunEstimate:
    """The estimate widened by the clock's bound on a shift common to all edges; None: never compared.

    A half width h becomes √(h² + bound²), as the bound is never exceeded; the standard error √(se² + bound²/3).
    """
    if bound_s is None:
        return replace(estimate, clock_uncertainty_s=None, flags=(*estimate.flags, "clock_unknown"))
    flags = (*estimate.flags, "clock_uncertain") if bound_s > WARN_S else estimate.flags
    estimate = replace(estimate, clock_uncertainty_s=bound_s, flags=flags)
    latency_s = estimate.latency_s
    if latency_s is None or bound_s == 0.0:
        return estimate
    estimate = widened(estimate, bound_s / np.sqrt(3.0))
    if estimate.latency_ci95_s is not None:
        low, high = (float(np.hypot(end - latency_s, bound_s)) for end in estimate.latency_ci95_s)
        estimate = replace(estimate, latency_ci95_s=(latency_s - low, latency_s + high))
    return estimate


def tap_uncertainty_s(taps: Taps | None, clocks: Sequence[ClockBounds]) -> float:
    """Half width of all taps' shift by the WALT's clock."""
    parts = [part for part in clocks if part.stream == "walt" and len(part.device_s)]
    if taps is None or not parts or not len(taps.physical_s):
        return 0.0
    try:
        epochs = list(fit_clocks(parts)["walt"].epochs.values())
    except DataError:
        return 0.0
    widths: list[FloatArray] = []
    for clock in epochs:
        # The file keeps taps on the host's clock; the mapping back needs no more than the offset.
        device_s = np.asarray(taps.physical_s - clock.offset_s, np.float64)
        device_s = device_s[(device_s >= clock.first_s - 1.0) & (device_s <= clock.last_s + 1.0)]
        if len(device_s):
            widths.append(clock.to_host(device_s)[1])
    return float(max(width.max() for width in widths)) if widths else 0.0


def warnings_of(session: Session, estimates: Sequence[RunEstimate], tap_bounds: Mapping[str, float]) -> list[str]:
    """Warnings about clocks."""
    said = [*_of_runs(estimates), *_of_taps(tap_bounds)]
    everything = [*session.clocks, *(part for run in session.runs for part in run.sync)]
    try:
        fits = fit_clocks(everything)
    except DataError as error:
        return [*said, message("The clock comparisons cannot be read: {problem}.", problem=error.problem)]
    # Of the width each run has had its say above.
    for fit in fits.values():
        said += clock_warnings(fit, of_width=False)
    return said


def _of_runs(estimates: Sequence[RunEstimate]) -> list[str]:
    said: list[str] = []
    unsure = {e.id: e.clock_uncertainty_s for e in estimates if "clock_uncertain" in e.flags}
    if unsure:
        worst = max(bound for bound in unsure.values() if bound is not None)
        said.append(
            message(
                "The laser's clock shifts the latency of {runs} by up to ±{worst:.2f} ms (more than {limit:.0f} "
                "ms); the intervals hold it. Use another port and close other programs.",
                runs=_listed(list(unsure)),
                worst=1e3 * worst,
                limit=1e3 * WARN_S,
            )
        )
    unknown = [e.id for e in estimates if "clock_unknown" in e.flags]
    if unknown:
        said.append(
            message(
                "The laser's clock was never compared with the host's in {runs}: a shift of the latency would "
                "not show. Record again with the clocks compared.",
                runs=_listed(unknown),
            )
        )
    return said


def _of_taps(bounds: Mapping[str, float]) -> list[str]:
    return [
        message("The {name}'s clock shifts the tap latencies by up to ±{worst:.2f} ms.", name=name, worst=1e3 * bound_s)
        for name, bound_s in bounds.items()
        if bound_s > WARN_S
    ]


def _listed(names: list[str]) -> str:
    shown = ", ".join(names[:4])
    return shown if len(names) <= 4 else message("{shown} and {n} more", shown=shown, n=len(names) - 4)
