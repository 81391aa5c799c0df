"""Digital filters of a panel's controller, stepped scan by scan: each sees the past and the present alone."""

from .chain import FILTERS, draw_filter, run_filters

__all__ = ["FILTERS", "draw_filter", "run_filters"]
