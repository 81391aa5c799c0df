"""A session's estimates, their tables, and their precision predicted from a protocol."""

from draglag.analysis.session import (
    Analysis,
    AnalysisOptions,
    analyze,
    curve_points,
    has_constant_speed,
    mean_by_protocol,
)

__all__ = ["Analysis", "AnalysisOptions", "analyze", "curve_points", "has_constant_speed", "mean_by_protocol"]
