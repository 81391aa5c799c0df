"""A smooth, unnamed term."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from draglag.gap.constants import LEAST_PRECISION, STATED_AT_MOST
from draglag.gap.fitting.heldout import floor_mm, gap_mm, shrinks_with
from draglag.gap.fitting.joint import Fit
from draglag.gap.fitting.signatures import shape_free
from draglag.gap.posterior.members import UNNAMED
from draglag.gap.posterior.pool import compared
from draglag.gap.results import GapReport, stated
from draglag.recording import FloatArray
from draglag.simulation.residual import View

POINTS = 25  # of the curve that is reported. Derived
TRIED = 4  # smooth terms, the most probable first. Derived: cost
UNITS = {
    "session_time": "s", "time_in_run": "s", "x": "mm", "speed": "mm/s", "acceleration": "mm/s²",
    "normal_acceleration": "mm/s²", "direction_angle": "rad",
}  # fmt: skip
ROLES = {"latency": "ms", "direction": "ms", "offset": "mm", "width": "mm"}


@dataclass(frozen=True)
class Provisional:
    """Smooth function of a covariate, without a name.

    role: latency, offset, width, or direction, a latency of opposite sign for opposite travel. probability: relative to
    noise alone. x, value, low, high: (k,) with 95 % band.
    """

    name: str
    covariate: str
    role: str
    probability: float
    gap_before_mm: float
    gap_after_mm: float
    noise_floor_mm: float
    improves: bool
    x: FloatArray
    value: FloatArray
    low: FloatArray
    high: FloatArray

    @property
    def unit(self) -> str:
        return ROLES[self.role]

    def words(self) -> str:
        """Size and benefit of the term."""
        k = int(np.abs(self.value).argmax())
        return (
            f"Provisional term {self.name} ({self.role}): gap {self.gap_before_mm:.3f} → {self.gap_after_mm:.3f} mm, "
            f"noise floor {self.noise_floor_mm:.3f} mm, probability {stated(self.probability)}; "
            f"at most {self.value[k]:.3g} {self.unit} ({self.low[k]:.3g} to {self.high[k]:.3g}) at {self.x[k]:.4g} "
            f"{UNITS[self.covariate]}. "
            "It has no name: look for the cause."
        )

    def to_dict(self) -> dict[str, object]:
        return {
            "name": self.name,
            "covariate": self.covariate,
            "role": self.role,
            "unit": self.unit,
            "probability": self.probability,
            "gap_before_mm": self.gap_before_mm,
            "gap_after_mm": self.gap_after_mm,
            "noise_floor_mm": self.noise_floor_mm,
            "improves": self.improves,
            "term": {
                "x": self.x.tolist(),
                "value": self.value.tolist(),
                "ci95": np.column_stack([self.low, self.high]).tolist(),
            },
        }


def provisional_term(report: GapReport) -> Provisional | None:
    """Most probable smooth term that shrinks the held-out gap, if any."""
    if report.last is None or report.judgement is None or report.unexplained_by is None:
        return None
    fit, smooth = report.last, shape_free(report.last.view)
    pool = compared([fit], frozenset(), report.judgement.pool.unsure_ages, most=0)
    mass = {key: pool.alone(f"{UNNAMED}{key[0]}:{key[1]}") for key in smooth}
    ranked = sorted(smooth, key=lambda key: -mass[key])
    same = [key for key in ranked if key[0] == report.unexplained_by]
    for covariate, role in (same or ranked)[:TRIED]:
        if shrinks_with(fit, smooth[covariate, role]):
            share = 1 / (1 + np.exp(pool.found[pool.emptiest].log_mass - mass[covariate, role]))
            return _added(fit, covariate, role, float(min(share, STATED_AT_MOST)), smooth[covariate, role])
    return None


def _added(fit: Fit, covariate: str, role: str, probability: float, columns: FloatArray) -> Provisional:
    prior = np.append(fit.prior, np.full(columns.shape[1], LEAST_PRECISION))
    design = np.column_stack([fit.design, columns])
    after = replace(fit, design=design, prior=prior)
    white = fit.white
    a, b = white.apply(design), white.apply(fit.residual_mm)
    spread = np.linalg.pinv(a.T @ a + np.diag(prior), hermitian=True)
    own = slice(fit.design.shape[1], None)
    size, covariance = (spread @ (a.T @ b))[own], spread[own, own]
    basis, scale = _per_unit(fit.view, role, columns)
    x = _values(fit.view, covariate)
    order = np.argsort(x)
    at = order[np.unique(np.linspace(0, x.size - 1, POINTS).astype(int))]
    value = scale * (basis[at] @ size)
    reach = 1.96 * abs(scale) * np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", basis[at], covariance, basis[at]), 0))
    return Provisional(
        f"unnamed:{covariate}",
        covariate,
        role,
        probability,
        gap_mm(fit),
        gap_mm(after),
        floor_mm(after),
        True,
        x[at],
        value,
        value - reach,
        value + reach,
    )


def _per_unit(view: View, role: str, columns: FloatArray) -> tuple[FloatArray, float]:
    """Function (m, k), and factor to ms or mm."""
    lever = view.v_across * view.stretch
    if role == "offset":
        return columns, 1.0
    if role == "width":
        return columns / (0.5 * view.side)[:, None], 1.0
    if role == "direction":
        lever = lever * np.sign(view.v_across)
    return columns / -np.where(np.abs(lever) < 1e-6, np.nan, lever)[:, None], 1e3


def _values(view: View, covariate: str) -> FloatArray:
    return {
        "session_time": view.since_start_s,
        "time_in_run": view.in_run_s,
        "x": view.x_mm,
        "speed": view.speed,
        "acceleration": view.accel,
        "normal_acceleration": view.a_across,
        "direction_angle": view.angle,
    }[covariate]
