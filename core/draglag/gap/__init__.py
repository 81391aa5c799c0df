"""Find where model and measurement differ, name the cause, add it, see the gap shrink.

``close_gap`` is the whole workflow; ``Model``, ``find``, ``name`` and ``shrinkage`` are its steps.
"""

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
