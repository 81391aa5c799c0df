"""Points of a caller's own, checked: (n,) speeds, latencies and their standard errors."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from draglag.arguments import other
from draglag.curve.points import CurvePoints
from draglag.errors import DataError
from draglag.messages import message
from draglag.recording import FloatArray

LONGEST_S = 5.0  # more is no drag latency: ms were given
SLOWEST_MM_S = 5.0  # where no speed is above it, m/s were given: no drag is faster than 5 m/s, most reach 100 mm/s


def numbers_of(given: ArrayLike) -> FloatArray:
    """An array of numbers. Raises DataError."""
    try:
        return np.asarray(given, float)
    except (TypeError, ValueError):
        raise other(message("numbers"), given, message("Give an array of numbers")) from None


def points_of(speed_mm_s: ArrayLike, latency_s: ArrayLike, se_s: ArrayLike) -> CurvePoints:
    """The points of a curve. Raises DataError where they differ in number, or cannot be in mm/s and s."""
    speed, latency = (np.atleast_1d(numbers_of(values)) for values in (speed_mm_s, latency_s))
    se = numbers_of(se_s)
    if speed.shape != latency.shape or speed.ndim != 1 or se.shape not in ((), (1,), speed.shape):
        raise DataError("speeds, latencies and their errors differ in number", "Give one latency for each speed")
    for name, values, sound, wanted in (
        ("speed_mm_s", speed, (speed > 0) & np.isfinite(speed), message("above 0 mm/s")),
        ("latency_s", latency, np.abs(latency) <= LONGEST_S, message("in seconds, {most:g} at most", most=LONGEST_S)),
        ("se_s", np.atleast_1d(se), np.atleast_1d((se > 0) & np.isfinite(se)), message("above 0 s")),
    ):
        if not sound.all():
            found = float(values[~sound][0])
            raise DataError(
                message("{name} holds {found:g}", name=name, found=found),
                message("Give numbers {wanted}", wanted=wanted),
            )
    if speed.size:
        _refuse_other_units(speed, latency)
    return CurvePoints(speed, latency, np.broadcast_to(se, speed.shape).copy())


def _refuse_other_units(speed_mm_s: FloatArray, latency_s: FloatArray) -> None:
    if speed_mm_s.max() <= SLOWEST_MM_S:
        raise DataError(
            message("speed_mm_s holds {most:g} at most, which is no drag's in mm/s", most=speed_mm_s.max()),
            "Give mm/s: multiply m/s by 1000",
        )
    if latency_s.max() <= 0:
        raise DataError("latency_s holds no number above 0", "Give latencies as how far the touch lags, in seconds")
