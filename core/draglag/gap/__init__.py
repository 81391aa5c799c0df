"""Closing the gap between model and measurement: ``close_gap``, or by hand ``find``, ``name`` and ``shrinkage``."""

from draglag.gap.compose import Gap, Model, Shrinkage, find, name, shrinkage
from draglag.gap.results import GapReport, Step
from draglag.gap.workflow import close_gap

__all__ = [
    "Gap",
    "GapReport",
    "Model",
    "Shrinkage",
    "Step",
    "close_gap",
    "find",
    "name",
    "shrinkage",
]
