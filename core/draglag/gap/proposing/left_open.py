"""Edges that effects leave open."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from draglag.gap.fitting.state import Term
from draglag.gap.proposing.of_effect import refit_module
from draglag.gap.traces.edges import Placed
from draglag.recording import FloatArray


def open_mm(placed: Placed, terms: Sequence[Term]) -> FloatArray:
    """Half range in which the terms leave each edge open, (m,)."""
    out = np.zeros(len(placed))
    for term in terms:
        own = refit_module(term.effect)
        if own is not None and hasattr(own, "open_mm"):
            out += own.open_mm(placed, term)
    return out
