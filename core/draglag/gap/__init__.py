"""Closing the gap: find where model and measurement differ, name the cause, add it, see the gap shrink."""

from draglag.gap.finding import Finding, find
from draglag.gap.naming import name
from draglag.gap.workflow import GapReport, Step, close_gap

__all__ = ["Finding", "GapReport", "Step", "close_gap", "find", "name"]
