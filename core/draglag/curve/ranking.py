"""Latency curves ranked by mean latency over shared speeds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from draglag.curve.fit import CurveFit
from draglag.curve.forms import FORMS
from draglag.curve.separable import jacobian_ms
from draglag.errors import EstimateError
from draglag.numerics import student_t

SPEEDS = 50  # that the mean is taken over, even in the logarithm of speed: each octave counts alike
DRAWS = 4000  # of all means by their errors: ends of a 95 % interval of ranks are known to one or two hundredths
LEVEL = 0.95


@dataclass(frozen=True)
class Ranked:
    """One curve's mean latency and rank (1: least), each with its 95 % interval."""

    name: str
    mean_s: float
    low_s: float
    high_s: float
    rank: int
    rank_low: int
    rank_high: int

    def to_dict(self) -> dict[str, object]:
        return {
            "session": self.name,
            "mean_latency_ms": 1e3 * self.mean_s,
            "mean_latency_ci95_ms": [1e3 * self.low_s, 1e3 * self.high_s],
            "rank": self.rank,
            "rank_ci95": [self.rank_low, self.rank_high],
        }


@dataclass(frozen=True)
class Ranking:
    """All curves, least latency first."""

    speed_range_mm_s: tuple[float, float]
    places: tuple[Ranked, ...]

    def to_dict(self) -> dict[str, object]:
        return {"speed_range_mm_s": list(self.speed_range_mm_s), "places": [place.to_dict() for place in self.places]}


def ranking(curves: Sequence[tuple[str, CurveFit]]) -> Ranking:
    """The curves by mean latency over the speeds all share. Raises EstimateError without any.

    Intervals hold 95 % of the ranks when means are drawn from their errors.
    """
    low = max(curve.speed_range_mm_s[0] for _, curve in curves)
    high = min(curve.speed_range_mm_s[1] for _, curve in curves)
    if not low < high:
        raise EstimateError("there is no speed at which all were measured", "Compare sessions of the same speeds")
    found = [_mean_s(curve, low, high) for _, curve in curves]
    mean, se, reach = (np.array(column) for column in zip(*found, strict=True))
    drawn = mean + se * np.random.default_rng(0).standard_normal((DRAWS, mean.size))
    ranks = 1 + np.argsort(np.argsort(drawn, axis=1), axis=1)
    ends = np.percentile(ranks, [50 * (1 - LEVEL), 50 * (1 + LEVEL)], axis=0, method="nearest").astype(int)
    order = np.argsort(mean, kind="stable")
    places = tuple(
        Ranked(
            curves[k][0], float(mean[k]), float(mean[k] - reach[k]), float(mean[k] + reach[k]), place,
            min(int(ends[0, k]), place), max(int(ends[1, k]), place),
        )
        for place, k in enumerate(order.tolist(), 1)
    )  # fmt: skip
    return Ranking((low, high), places)


def _mean_s(curve: CurveFit, low_mm_s: float, high_mm_s: float) -> tuple[float, float, float]:
    speed = np.geomspace(max(low_mm_s, 1e-3), high_mm_s, SPEEDS)
    form = FORMS[curve.form]
    slope = jacobian_ms(form, curve.values, speed).mean(0)
    se_s = 1e-3 * float(np.sqrt(max(slope @ curve.covariance @ slope, 0.0)))
    wide = student_t(max(curve.n_points - form.n_parameters, 1), 0.5 + LEVEL / 2)
    return float(curve.predict_s(speed).mean()), se_s, wide * se_s
