"""The paper's sanity checks (Section II.C, III.B–C)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from draglag.curve import CurveFit
from draglag.instruments.taps import TapSummary
from draglag.latency import RunEstimate
from draglag.messages import message
from draglag.recording import ClockBounds, FloatArray, Session

MARGIN_S = 0.003  # the mean least noticeable drag latency is 6 ms (the paper, Section I): half of it
DRIFT_LIMIT_MS_PER_MIN = 1.0  # what the paper demands of a clock


@dataclass(frozen=True)
class AsymptoteCheck:
    """Median tap less the curve's asymptote a7.

    ``equivalent``: both one-sided tests at 5 % exclude ``margin_s`` or more (TOST).
    """

    kind: str
    difference_s: float
    ci95_s: tuple[float, float]
    margin_s: float
    p_value: float

    @property
    def equivalent(self) -> bool:
        return self.p_value < 0.05

    def to_dict(self) -> dict[str, object]:
        return {
            "taps": self.kind,
            "difference_ms": 1e3 * self.difference_s,
            "difference_ci95_ms": [1e3 * v for v in self.ci95_s],
            "margin_ms": 1e3 * self.margin_s,
            "p_value": self.p_value,
            "equivalent": self.equivalent,
        }


def asymptote_check(
    curve: CurveFit, taps: Mapping[str, TapSummary], margin_s: float = MARGIN_S
) -> list[AsymptoteCheck]:
    """One check a kind of tap; none if the curve has no asymptote or a tied one."""
    if "a7_ms" not in curve.parameters or curve.tied_asymptote_s is not None:
        return []
    asymptote_s = 1e-3 * curve.parameters["a7_ms"]
    asymptote_se = 1e-3 * curve.standard_errors["a7_ms"]
    out = []
    for kind, summary in taps.items():
        se = max(float(np.hypot(summary.median_se_s, asymptote_se)), 1e-9)
        difference = summary.median_s - asymptote_s
        p_value = 0.5 * math.erfc((margin_s - abs(difference)) / (np.sqrt(2) * se))
        out.append(
            AsymptoteCheck(kind, difference, (difference - 1.96 * se, difference + 1.96 * se), margin_s, p_value)
        )
    return out


@dataclass(frozen=True)
class WidthCheck:
    """Mean stylus width by Eq. 3 against the known diameter."""

    n: int
    mean_mm: float
    ci95_mm: tuple[float, float]
    known_mm: float

    def to_dict(self) -> dict[str, object]:
        return {
            "n": self.n,
            "mean_mm": self.mean_mm,
            "mean_ci95_mm": list(self.ci95_mm),
            "known_mm": self.known_mm,
            "difference_mm": self.mean_mm - self.known_mm,
        }


# Systematic half width (95 %) of a stylus width. A comparator at 20 to 50 % of the light of a Gaussian beam (sigma
# 0.15 to 0.4 mm) sees the disc narrower by 2 z sigma, 0.21 mm with a standard deviation of 0.17 mm: 1.96 * hypot of
# both.
WIDTH_SYSTEMATIC_MM = 0.53


def width_findings(check: WidthCheck | None, runs: Sequence[RunEstimate]) -> list[str]:
    """Sentences where widths disagree with the known diameter beyond noise and sensor."""
    if check is None:
        return []
    low, high = check.ci95_mm
    if abs(check.mean_mm - check.known_mm) > np.hypot(0.5 * (high - low), WIDTH_SYSTEMATIC_MM):
        return [
            message(
                "The stylus measures {mean:.2f} mm ({low:.2f} to {high:.2f}), by ruler {known:g} mm: more than "
                "noise and sensor explain. A wrong diameter, a wrong scale of the touchscreen, a filter that "
                "shrinks circles or a slow sensor can do this. Measure the stylus, calibrate the touchscreen, "
                "and see draglag gap.",
                mean=check.mean_mm,
                low=low,
                high=high,
                known=check.known_mm,
            )
        ]
    off = [
        run.id
        for run in runs
        if run.stylus_diameter_mm is not None
        and run.stylus_diameter_se_mm is not None
        and abs(run.stylus_diameter_mm - check.known_mm)
        > np.hypot(1.96 * run.stylus_diameter_se_mm, WIDTH_SYSTEMATIC_MM)
    ]
    if not off:
        return []
    return [
        message(
            "The stylus width of {runs} disagrees with the ruler ({known:g} mm) by more than noise and "
            "sensor explain: a tilted stylus or wrong edges can do this. Look at the alignment, or record "
            "again.",
            runs=", ".join(off),
            known=check.known_mm,
        )
    ]


def width_check(runs: Sequence[RunEstimate], known_mm: float) -> WidthCheck | None:
    """Mean width over runs, its interval from their scatter, or of one run from its noise; None without a width."""
    known = [(run.stylus_diameter_mm, run.stylus_diameter_se_mm or 0.0) for run in runs if run.stylus_diameter_mm]
    widths, errors = np.array(known, float).reshape(-1, 2).T
    widths, errors = widths[np.isfinite(widths)], errors[np.isfinite(widths)]
    if not widths.size:
        return None
    se = float(widths.std(ddof=1) / np.sqrt(widths.size)) if widths.size > 1 else float(errors[0])
    mean, half = float(widths.mean()), 1.96 * se
    return WidthCheck(int(widths.size), mean, (mean - half, mean + half), known_mm)


@dataclass(frozen=True)
class ClockDrift:
    """Rate of a device's clock against the host's."""

    stream: str
    ppm: float
    se_ppm: float
    residual_ms: float
    span_s: float

    @property
    def ms_per_minute(self) -> float:
        return 60e-3 * self.ppm

    def to_dict(self) -> dict[str, object]:
        return {
            "stream": self.stream,
            "drift_ppm": self.ppm,
            "drift_se_ppm": self.se_ppm,
            "ms_per_minute": self.ms_per_minute,
            "residual_ms": self.residual_ms,
            "span_s": self.span_s,
            "within_1_ms_per_minute": abs(self.ms_per_minute) <= DRIFT_LIMIT_MS_PER_MIN,
        }


def clock_drifts(session: Session) -> list[ClockDrift]:
    """Drift of every compared device clock over its longest epoch."""
    bounds = list(session.clocks) + [bound for run in session.runs for bound in run.sync]
    streams = dict.fromkeys(bound.stream for bound in bounds)
    found = (_drift_of(stream, [bound for bound in bounds if bound.stream == stream]) for stream in streams)
    return [drift for drift in found if drift is not None]


def _drift_of(stream: str, bounds: list[ClockBounds]) -> ClockDrift | None:
    """Least-squares drift; None with fewer than three comparisons in an epoch."""
    t_s, late_s = _longest_epoch(bounds)
    if t_s.size < 3 or np.ptp(t_s) <= 0:
        return None
    centred = t_s - t_s.mean()
    slope = float(centred @ (late_s - late_s.mean()) / (centred @ centred))
    residual = late_s - late_s.mean() - slope * centred
    se = float(np.sqrt(residual @ residual / max(t_s.size - 2, 1) / (centred @ centred)))
    # The host's clock gains on the device's where the device runs slow.
    return ClockDrift(stream, -1e6 * slope, 1e6 * se, 1e3 * float(residual.std()), float(np.ptp(t_s)))


def _longest_epoch(bounds: list[ClockBounds]) -> tuple[FloatArray, FloatArray]:
    """Device times of the epoch with most comparisons, and the host's clock less the device's; empty without any."""
    device = np.concatenate([b.device_s for b in bounds])
    low, high = (np.concatenate([getattr(b, name) for b in bounds]) for name in ("host_min_s", "host_max_s"))
    epoch = np.concatenate([b.epoch if b.epoch.size == b.device_s.size else np.zeros(b.device_s.size) for b in bounds])
    good = np.isfinite(device) & np.isfinite(low) & np.isfinite(high)
    if good.any():
        values, counts = np.unique(epoch[good], return_counts=True)
        good &= epoch == values[np.argmax(counts)]
    return device[good], 0.5 * (low + high)[good] - device[good]
