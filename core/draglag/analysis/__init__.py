"""A session's estimates, their tables, and predicted precision."""

from draglag.analysis.session import (
    Analysis,
    AnalysisOptions,
    analyze,
    curve_points,
    mean_by_protocol,
    with_stylus,
)
from draglag.latency.steady import has_constant_speed

__all__ = [
    "Analysis",
    "AnalysisOptions",
    "analyze",
    "curve_points",
    "has_constant_speed",
    "mean_by_protocol",
    "with_stylus",
]
