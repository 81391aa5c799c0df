"""Eq. 5 plus a Gaussian process in ln v."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Self

import numpy as np

from draglag.curve import CurvePoints
from draglag.gap.constants import LAW_KNOTS, LAW_LENGTH
from draglag.gap.fitting.model import LawParameters, eq5_through
from draglag.recording import FloatArray

LAW_FORM = "law_form"
BEYOND = 0.3  # of ln v beyond the outermost knots: there the form stays what it is. Judgement
FORM_SD_S = 0.01  # of a step of the remainder: screens' laws lie within some 10 ms of the nearest Eq. 5. Physical
TRIVIAL = 1e-3  # of a knot's variance: directions of less are rounding. Derived
SPEEDS = 60  # at which a curve is compared with Eq. 5. Derived: cost


@dataclass(frozen=True)
class FlexibleLaw(LawParameters):
    """Eq. 5 plus a smooth remainder; knots in ln v."""

    knots: tuple[float, ...] = ()
    remainder_s: tuple[float, ...] = ()

    def __call__(self, speed_mm_s: FloatArray) -> FloatArray:
        speed = np.asarray(speed_mm_s, float)
        rest = basis(np.ravel(speed), self.knots) @ np.array(self.remainder_s)
        return np.asarray(super().__call__(speed) + rest.reshape(speed.shape))

    def columns(self, speed_mm_s: FloatArray) -> FloatArray:
        """Columns of Eq. 5, then of the remainder, (m, 5 + k).

        The rates stay: what they would change the remainder can, and both together have no single best point.
        """
        of_eq5 = super().columns(speed_mm_s)
        of_eq5[:, [1, 3]] = 0.0
        return np.column_stack([of_eq5, basis(speed_mm_s, self.knots)])

    @property
    def step_sd(self) -> tuple[float, ...]:
        return *super().step_sd, *(FORM_SD_S,) * len(self.remainder_s)

    def moved(self, step: FloatArray) -> Self:
        n = len(self.remainder_s)
        remainder = tuple(float(old + more) for old, more in zip(self.remainder_s, step[-n:], strict=True))
        return replace(super().moved(step[:-n]), remainder_s=remainder)


def knots_over(speed_mm_s: FloatArray) -> tuple[float, ...]:
    """Knots in ln v over these speeds."""
    ln = np.log(np.maximum(speed_mm_s, 1.0))
    low, high = np.quantile(ln, [0.005, 0.995])
    return tuple(float(at) for at in np.linspace(low - 0.1, high + 0.1, LAW_KNOTS))


def basis(speed_mm_s: FloatArray, knots: tuple[float, ...]) -> FloatArray:
    """Directions of the Gaussian process, (m, k), of unit prior variance."""
    at = np.array(knots)
    ln = np.clip(np.log(np.maximum(speed_mm_s, 1.0)), at[0] - BEYOND, at[-1] + BEYOND)
    return np.asarray(_covariance(ln, at) @ _directions(knots))


@lru_cache(maxsize=64)
def _directions(knots: tuple[float, ...]) -> FloatArray:
    at = np.array(knots)
    variance, axes = np.linalg.eigh(_covariance(at, at))
    return np.asarray(axes / np.sqrt(np.maximum(variance, TRIVIAL)))


def _covariance(one: FloatArray, other: FloatArray) -> FloatArray:
    return np.asarray(np.exp(-0.5 * np.subtract.outer(one, other) ** 2 / LAW_LENGTH**2))


def flexible(law: LawParameters, knots: tuple[float, ...]) -> FlexibleLaw:
    """Eq. 5 with a remainder of zero."""
    none = (0.0,) * len(knots)
    return FlexibleLaw(law.a1_s, law.a2_s_mm, law.a4_s, law.a5_s_mm, law.a7_s, 0.0, knots, none)


def _speeds(speed_mm_s: FloatArray) -> FloatArray:
    low, high = np.quantile(speed_mm_s, [0.01, 0.99])
    return np.geomspace(float(low), float(high), SPEEDS)


def nearest_eq5(law: LawParameters, speed_mm_s: FloatArray) -> LawParameters:
    """Nearest Eq. 5 over these speeds; unchanged if it is one."""
    if not isinstance(law, FlexibleLaw):
        return law
    v = _speeds(speed_mm_s)
    return eq5_through(CurvePoints(v, law(v), np.ones(v.size)))


def remainder_rms_s(law: LawParameters, speed_mm_s: FloatArray) -> float:
    """RMS difference from the nearest Eq. 5."""
    v = _speeds(speed_mm_s)
    return float(np.sqrt(np.mean((law(v) - nearest_eq5(law, speed_mm_s)(v)) ** 2)))
