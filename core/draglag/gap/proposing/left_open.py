"""By how much effects leave open where the edges lie that they cannot be judged by."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from draglag.gap.fitting.state import Term
from draglag.gap.proposing.own_way import own_way
from draglag.gap.traces.edges import Placed
from draglag.recording import FloatArray


def open_mm(placed: Placed, terms: Sequence[Term]) -> FloatArray:
    """By how much the terms leave open where each edge lies that they cannot be judged by, (m,) mm either way."""
    out = np.zeros(len(placed))
    for term in terms:
        own = own_way(term.effect)
        if own is not None and hasattr(own, "open_mm"):
            out += own.open_mm(placed, term)
    return out
