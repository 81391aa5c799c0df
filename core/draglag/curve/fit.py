"""L(v) fitted to a session's runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from draglag.curve.forms import FORMS, Form
from draglag.curve.points import CurvePoints, distinct_speeds
from draglag.curve.separable import evaluated_ms, jacobian_ms, shown_s, slope_s_per_mm_s, solved
from draglag.errors import DataError, EstimateError
from draglag.messages import message, phrase
from draglag.numerics import student_t
from draglag.recording import FloatArray
from draglag.shown import table_html

FEWEST_SPEEDS = 5  # as many as Eq. 5 has coefficients: fewer do not identify a decay
RESOLVED_MS = 1e-6  # of a latency: no clock resolves a nanosecond
CLEARLY_BETTER = 6.0  # AICc units a rival must gain before it replaces Eq. 5


@dataclass(frozen=True)
class Rival:
    form: str
    aicc: float
    held_out_rms_s: float


@dataclass(frozen=True)
class CurveFit:
    """A fitted curve.

    Attributes:
        values: shape parameters then amplitudes, in the order of the form's names.
        covariance: of ``values``; zero rows for parameters at a bound.
        rms_s: RMS of L − L̂ over the points, unweighted (Table 2).
        between_runs_s: scatter of runs about the curve beyond their standard errors.
        tied_asymptote_s: tap latency at which a7 was held.
    """

    form: str
    values: FloatArray
    covariance: FloatArray
    rms_s: float
    speed_range_mm_s: tuple[float, float]
    between_runs_s: float
    n_points: int
    aicc: float
    held_out_rms_s: float
    rivals: tuple[Rival, ...] = ()
    tied_asymptote_s: float | None = None
    points: CurvePoints | None = field(default=None, repr=False)

    @property
    def parameters(self) -> Mapping[str, float]:
        return dict(zip(FORMS[self.form].names, (float(v) for v in self.values), strict=True))

    @property
    def standard_errors(self) -> Mapping[str, float]:
        spread = np.sqrt(np.maximum(np.diag(self.covariance), 0))
        return dict(zip(FORMS[self.form].names, (float(v) for v in spread), strict=True))

    @property
    def half_intervals(self) -> Mapping[str, float]:
        """Half the 95 % interval of every parameter."""
        return {name: self._reach(0.95) * error for name, error in self.standard_errors.items()}

    @property
    def correlations(self) -> Mapping[tuple[str, str], float]:
        """Of every two fitted parameters, the strongest first; without those at a bound or tied."""
        free = [(name, k) for k, name in enumerate(FORMS[self.form].names) if self.covariance[k, k] > 0]
        spread = np.sqrt(np.maximum(np.diag(self.covariance), 0))
        pairs = {
            (one, other): float(self.covariance[i, j] / (spread[i] * spread[j]))
            for (one, i), (other, j) in combinations(free, 2)
        }
        return dict(sorted(pairs.items(), key=lambda item: -abs(item[1])))

    def _reach(self, level: float) -> float:
        return student_t(max(self.n_points - FORMS[self.form].n_parameters, 1), 0.5 + level / 2)

    def predict_s(self, speed_mm_s: ArrayLike) -> FloatArray:
        """L(v), s, in the shape of the speeds; an extrapolation where not ``inside``. Raises DataError below 0 mm/s."""
        speed = _speeds(speed_mm_s)
        return 1e-3 * evaluated_ms(FORMS[self.form], self.values, speed.ravel()).reshape(speed.shape)

    def inside(self, speed_mm_s: FloatArray) -> np.ndarray:
        """Which speeds lie within the measured range."""
        speed = np.asarray(speed_mm_s, float)
        return (speed >= self.speed_range_mm_s[0]) & (speed <= self.speed_range_mm_s[1])

    def band_s(self, speed_mm_s: ArrayLike, level: float = 0.95) -> tuple[FloatArray, FloatArray]:
        """Pointwise confidence band (delta method), low and high, s, (n,) each. Raises DataError below 0 mm/s."""
        speed = np.atleast_1d(_speeds(speed_mm_s))
        form = FORMS[self.form]
        jacobian = jacobian_ms(form, self.values, speed)
        se = np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", jacobian, self.covariance, jacobian), 0))
        reach = self._reach(level) * se
        middle = evaluated_ms(form, self.values, speed)
        return 1e-3 * (middle - reach), 1e-3 * (middle + reach)

    def to_dict(self) -> dict[str, object]:
        """JSON of the curve."""
        return {
            "form": self.form,
            "parameters": dict(self.parameters),
            "standard_errors": dict(self.standard_errors),
            "rms_ms": 1e3 * self.rms_s,
            "between_runs_ms": 1e3 * self.between_runs_s,
            "speed_range_mm_s": list(self.speed_range_mm_s),
            "n_points": self.n_points,
            "tied_asymptote_ms": None if self.tied_asymptote_s is None else 1e3 * self.tied_asymptote_s,
            "rivals": [
                {"form": r.form, "aicc": r.aicc, "held_out_rms_ms": 1e3 * r.held_out_rms_s} for r in self.rivals
            ],
        }

    def __repr__(self) -> str:
        parameters = ", ".join(f"{name}={value:.4g}" for name, value in self.parameters.items())
        low, high = self.speed_range_mm_s
        return (
            f"CurveFit({self.form}: {parameters}; RMS {1e3 * self.rms_s:.2f} ms over {self.n_points} runs, "
            f"{low:.0f} to {high:.0f} mm/s)"
        )

    def _repr_html_(self) -> str:
        half = self.half_intervals
        # A parameter at a bound, or tied without an error, has no interval: a dash, not ± 0.
        rows = [(name, value, half[name] or None) for name, value in self.parameters.items()]
        return table_html(f"Curve: {self.form.replace('_', ' ')}", ["parameter", "value", "± (95 %)"], rows)

    def plot(self, ax: Any = None) -> Any:
        """Matplotlib axes with curve and 95 % band."""
        from draglag.drawing.results import draw_curve, own_axes

        axes = own_axes(ax)
        draw_curve(axes, self)
        return axes


def _speeds(given: ArrayLike) -> FloatArray:
    speed = np.asarray(given, float)
    if (below := speed < 0).any():
        found = message("a speed of {speed:g} mm/s is below 0", speed=speed[below].max())
        raise DataError(found, "Give speeds from 0 mm/s on")
    return speed


def fit_form(
    points: CurvePoints, form_name: str, tied_asymptote_s: float | None = None, tied_se_s: float = 0.0
) -> CurveFit:
    """One form fitted. Raises EstimateError with fewer points than parameters.

    ``tied_asymptote_s`` holds a7 at the tap latency ("corrected" in Table 2), whose standard error is ``tied_se_s``.
    """
    form = FORMS[form_name]
    if tied_asymptote_s is not None and "a7_ms" not in form.names:
        raise EstimateError(
            message("the form {form} has no asymptote to tie", form=form_name), "Choose an exponential form"
        )
    free = form.n_parameters - (tied_asymptote_s is not None)
    if points.speed_mm_s.size < free:
        raise EstimateError(
            message(
                "{n} runs cannot determine the {k} parameters of {form}",
                n=points.speed_mm_s.size,
                k=free,
                form=phrase(form.title),
            ),
            "Measure more speeds or choose a simpler form",
        )
    # From loose to tight: with the runs' own standard errors alone the fastest runs would pin the first descent.
    between_s, values, measured = 5e-4, np.empty(0), points
    for _ in range(4):
        weight = 1 / np.sqrt(points.se_s**2 + between_s**2)
        values = solved(form, points, weight, tied_asymptote_s, values if values.size else None)
        points = measured.with_speed_error(slope_s_per_mm_s(form, values, measured.speed_mm_s))
        updated = _between_runs(points, shown_s(form, values, points), free)
        settled = abs(updated - between_s) < 0.1 * max(updated, 1e-6)
        between_s = updated
        if settled:
            break
    variance = points.se_s**2 + between_s**2
    finished = _finish(form, points, values, variance, between_s, tied_asymptote_s, tied_se_s)
    return replace(finished, points=measured)


def fit_best(
    points: CurvePoints,
    tied_asymptote_s: float | None = None,
    forms: Sequence[str] = tuple(FORMS),
    tied_se_s: float = 0.0,
) -> CurveFit:
    """Eq. 5, unless a rival's AICc is lower by more than 6 and its held-out error no larger; of too few runs for it
    the form with the smallest held-out error, of those whose AICc is within 6 of the lowest.

    Raises EstimateError with fewer than ``FEWEST_SPEEDS`` different speeds.
    """
    n_speeds = distinct_speeds(points.speed_mm_s)
    if n_speeds < FEWEST_SPEEDS:
        raise EstimateError(
            message(
                "{n} different speeds are too few for a curve: at least {k} are needed", n=n_speeds, k=FEWEST_SPEEDS
            ),
            "Record runs at more speeds",
        )
    fits = []
    for name in forms:
        try:
            tied = tied_asymptote_s if "a7_ms" in FORMS[name].names else None
            fit = fit_form(points, name, tied, tied_se_s)
        except EstimateError:
            continue
        fits.append(replace(fit, held_out_rms_s=_held_out_rms_s(points, fit)))
    if not fits:
        raise EstimateError("no run gave a latency, so there is no curve", "Record runs at several speeds")
    rivals = tuple(sorted((Rival(f.form, f.aicc, f.held_out_rms_s) for f in fits), key=lambda r: r.aicc))
    by_name = {f.form: f for f in fits}
    ranked = sorted(fits, key=lambda f: f.aicc)
    chosen = by_name.get("double_exponential", ranked[0])
    if not np.isfinite(chosen.aicc):
        # AICc of so few runs takes the simplest form unless another misses far less: held-out runs decide between
        # forms that it ranks alike.
        alike = [fit for fit in ranked if fit.aicc - ranked[0].aicc < CLEARLY_BETTER]
        chosen = min(alike, key=lambda fit: fit.held_out_rms_s)
    for fit in ranked:
        better = chosen.aicc - fit.aicc > CLEARLY_BETTER and fit.held_out_rms_s <= 1.05 * chosen.held_out_rms_s
        if better:
            chosen = fit
            break
    return replace(chosen, rivals=rivals, points=points)


def _between_runs(points: CurvePoints, predicted_s: FloatArray, n_free: int) -> float:
    """Extra scatter by Paule–Mandel."""
    squared = (points.latency_s - predicted_s) ** 2
    dof = points.latency_s.size - n_free
    if dof < 1 or np.sum(squared / points.se_s**2) <= dof:
        return 0.0
    # Falling and convex in the extra variance: Newton's steps from below never pass the root.
    known, extra = points.se_s**2, 0.0
    for _ in range(60):
        share = squared / (known + extra)
        step = (float(share.sum()) - dof) / float((share / (known + extra)).sum())
        extra += step
        if step <= 1e-12 * extra:
            break
    return float(np.sqrt(extra))


def _finish(
    form: Form,
    points: CurvePoints,
    values: FloatArray,
    variance_s2: FloatArray,
    between_s: float,
    tied_s: float | None,
    tied_se_s: float,
) -> CurveFit:
    speed = points.speed_mm_s
    error_s = points.latency_s - shown_s(form, values, points)
    n, k = speed.size, form.n_parameters - (tied_s is not None)
    jacobian = 1e-3 * jacobian_ms(form, values, speed)
    # By how much each parameter moves the curve: an amplitude at its bound, but for rounding, and its rate do not.
    free = 1e3 * np.abs(jacobian * values).max(0) > RESOLVED_MS
    if tied_s is not None:
        free[-1] = False
    covariance = np.zeros((values.size, values.size))
    normal = (jacobian[:, free] / variance_s2[:, None]).T @ jacobian[:, free]
    # Scaled, so that rates in s/mm and amplitudes in ms weigh alike: what the runs leave open has a wide interval.
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-30))
    even = normal / np.outer(scale, scale) + 1e-12 * np.eye(scale.size)
    covariance[np.ix_(free, free)] = np.linalg.inv(even) / np.outer(scale, scale)
    if tied_s is not None and tied_se_s > 0:
        # Delta method: a tap median off by δ moves the others by −(JᵀWJ)⁻¹JᵀW·∂L/∂a7·δ.
        moved = np.zeros(values.size)
        moved[-1] = 1.0
        moved[free] = -covariance[np.ix_(free, free)] @ (jacobian[:, free].T @ (jacobian[:, -1] / variance_s2))
        covariance += (1e3 * tied_se_s) ** 2 * np.outer(moved, moved)
    penalty = 2 * k + 2 * k * (k + 1) / (n - k - 1) if n > k + 1 else np.inf
    # The runs' own standard errors are known; the scatter between runs is profiled, so both enter the likelihood.
    deviance = float(np.sum(error_s**2 / variance_s2 + np.log(variance_s2)))
    return CurveFit(
        form=form.name,
        values=values,
        covariance=covariance,
        rms_s=float(np.sqrt(np.mean(error_s**2))),
        speed_range_mm_s=(float(speed.min()), float(speed.max())),
        between_runs_s=between_s,
        n_points=n,
        aicc=deviance + penalty,
        held_out_rms_s=float("nan"),
        tied_asymptote_s=tied_s,
        points=points,
    )


def _held_out_rms_s(points: CurvePoints, fit: CurveFit) -> float:
    form = FORMS[fit.form]
    n = points.speed_mm_s.size
    if n <= form.n_parameters:
        return float("inf")
    se_s = points.with_speed_error(slope_s_per_mm_s(form, fit.values, points.speed_mm_s)).se_s
    # Leaving one run out of a (locally) linear fit multiplies its residual by 1 / (1 − leverage).
    variance = se_s**2 + fit.between_runs_s**2
    jacobian = 1e-3 * jacobian_ms(form, fit.values, points.speed_mm_s)
    leverage = np.einsum("ni,ij,nj->n", jacobian, fit.covariance, jacobian) / variance
    error_s = points.latency_s - shown_s(form, fit.values, points)
    return float(np.sqrt(np.mean((error_s / np.maximum(1 - leverage, 0.02)) ** 2)))
