"""The latency curve's own form: a smooth function of ln v added to Eq. 5, as a Gaussian process.

Screens follow laws of other forms than Eq. 5: constant, power, logistic, adaptive low-passes. Such a curve is no gap.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.optimize import least_squares

from draglag.gap.constants import LAW_KNOTS, LAW_LENGTH
from draglag.gap.fitting.model import LEAST_AMPLITUDE_S, LEAST_RATE_S_MM, MOST_RATE_S_MM, LawParameters
from draglag.recording import FloatArray
from draglag.simulation.residual import LineGains, Signature, View

LAW_FORM = "law_form"
BEYOND = 0.3  # of ln v beyond the outermost knots: there the form stays what it is
FORM_SD_S = 0.01  # of a step of the remainder: screens' laws lie within some 10 ms of the nearest Eq. 5
TRIVIAL = 1e-3  # of a knot's variance: directions of less are rounding
RATES_S_MM = ((4e-3, 2.2e-2), (1.5e-3, 8e-3), (2e-3, 3e-2), (6e-3, 6e-2))  # to begin from: screens published so far
SPEEDS = 60  # at which a curve is compared with Eq. 5


@dataclass(frozen=True)
class FlexibleLaw(LawParameters):
    """Eq. 5 plus a smooth remainder: knots in ln v and the size of each direction, s."""

    knots: tuple[float, ...] = ()
    remainder_s: tuple[float, ...] = ()

    def __call__(self, speed_mm_s: FloatArray) -> FloatArray:
        speed = np.asarray(speed_mm_s, float)
        law = super().__call__(speed)
        if not self.remainder_s:
            return law
        rest = basis(np.ravel(self.counted_mm_s(speed)), self.knots) @ np.array(self.remainder_s)
        return np.asarray(law + rest.reshape(speed.shape))

    @property
    def nearest(self) -> LawParameters:
        """Eq. 5 without the remainder."""
        return LawParameters(self.a1_s, self.a2_s_mm, self.a4_s, self.a5_s_mm, self.a7_s, self.plateau_mm_s)


class LawForm:
    """The curve's own form as a term of a fit, with the interface that effects have."""

    id = LAW_FORM

    @classmethod
    def signatures(cls, view: View, gains: LineGains | None = None) -> list[Signature]:
        return [cls.signature_at(knots_over(view.speed), view)]

    @classmethod
    def signature_at(cls, theta: tuple[float, ...], view: View) -> Signature:
        return Signature(latency=basis(view.speed, theta), theta=theta)


def knots_over(speed_mm_s: FloatArray) -> tuple[float, ...]:
    """Knots in ln v over the speeds of a session."""
    ln = np.log(np.maximum(speed_mm_s, 1.0))
    low, high = np.quantile(ln, [0.005, 0.995])
    return tuple(float(at) for at in np.linspace(low - 0.1, high + 0.1, LAW_KNOTS))


def basis(speed_mm_s: FloatArray, knots: tuple[float, ...]) -> FloatArray:
    """Directions of a Gaussian process with the knots' covariance, (m, k), of unit prior variance each."""
    at = np.array(knots)
    ln = np.clip(np.log(np.maximum(speed_mm_s, 1.0)), at[0] - BEYOND, at[-1] + BEYOND)
    return np.asarray(_covariance(ln, at) @ _directions(knots))


@lru_cache(maxsize=64)
def _directions(knots: tuple[float, ...]) -> FloatArray:
    """Sizes of the covariances with the knots that make the directions, (knots, k)."""
    at = np.array(knots)
    variance, axes = np.linalg.eigh(_covariance(at, at))
    return np.asarray(axes / np.sqrt(np.maximum(variance, TRIVIAL)))


def _covariance(one: FloatArray, other: FloatArray) -> FloatArray:
    return np.asarray(np.exp(-0.5 * np.subtract.outer(one, other) ** 2 / LAW_LENGTH**2))


def split(law: LawParameters, knots: tuple[float, ...], sizes: FloatArray, speed_mm_s: FloatArray) -> FlexibleLaw:
    """A curve as the Eq. 5 nearest to it and the remainder.

    Args: law: what the curve is made of, with ``sizes`` of the directions over ``knots`` added; speed_mm_s: of the
    session's edges.
    """
    v = _speeds(speed_mm_s)
    curve = law(v) + basis(v, knots) @ sizes
    nearest = _nearest(v, curve)
    directions = basis(v, knots)
    gram = directions.T @ directions
    ridge = 1e-6 * np.trace(gram) / gram.shape[0] * np.eye(gram.shape[0])
    rest = np.linalg.solve(gram + ridge, directions.T @ (curve - nearest(v)))
    return FlexibleLaw(
        nearest.a1_s, nearest.a2_s_mm, nearest.a4_s, nearest.a5_s_mm, nearest.a7_s, 0.0, knots, tuple(map(float, rest))
    )


def _speeds(speed_mm_s: FloatArray) -> FloatArray:
    """Speeds over those of the edges, evenly in ln v."""
    low, high = np.quantile(speed_mm_s, [0.01, 0.99])
    return np.geomspace(float(low), float(high), SPEEDS)


def _nearest(speed_mm_s: FloatArray, latency_s: FloatArray) -> LawParameters:
    """Eq. 5 by least squares, from several starts."""

    def law(p: FloatArray) -> LawParameters:
        a1, a2, a4, a5 = (float(q) for q in np.exp(p[:4]))
        return LawParameters(a1, a2, a4, a5, float(p[4]))

    amplitude, rate = np.log([LEAST_AMPLITUDE_S, 1.0]), np.log([1.03 * LEAST_RATE_S_MM, 0.95 * MOST_RATE_S_MM])
    low = np.array([amplitude[0], rate[0], amplitude[0], rate[0], -0.2])
    high = np.array([amplitude[1], rate[1], amplitude[1], rate[1], 0.3])
    fits = []
    for slow, fast in RATES_S_MM:
        begin = np.array([np.log(0.05), np.log(slow), np.log(0.05), np.log(fast), max(float(latency_s.min()), 0.0)])
        begin = np.clip(begin, low + 1e-3, high - 1e-3)
        fits.append(
            least_squares(lambda p: 1e3 * (law(p)(speed_mm_s) - latency_s), begin, bounds=(low, high), max_nfev=200)
        )
    return law(min(fits, key=lambda fit: float(fit.cost)).x)


def remainder_rms_s(law: LawParameters, speed_mm_s: FloatArray) -> float:
    """By how much a law misses its nearest Eq. 5, RMS over the speeds, s; 0 for Eq. 5 itself."""
    if not isinstance(law, FlexibleLaw) or not law.remainder_s:
        return 0.0
    v = _speeds(speed_mm_s)
    return float(np.sqrt(np.mean((law(v) - law.nearest(v)) ** 2)))
