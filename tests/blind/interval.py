"""Rates and their binomial intervals."""

from collections.abc import Iterable
from typing import Any

from scipy.stats import beta


def interval(hits: int, n: int, level: float = 0.95) -> tuple[float, float]:
    """Clopper–Pearson interval of a rate."""
    tail = (1 - level) / 2
    low = 0.0 if hits == 0 else float(beta.ppf(tail, hits, n - hits + 1))
    high = 1.0 if hits == n else float(beta.ppf(1 - tail, hits + 1, n - hits))
    return low, high


def rate(flags: Iterable[bool]) -> dict[str, Any]:
    """Count, rate and interval of a list of yes and no."""
    values = list(flags)
    hits = sum(values)
    bounds = interval(hits, len(values)) if values else (0.0, 1.0)
    return {"n": len(values), "hits": hits, "rate": hits / len(values) if values else None, "ci95": list(bounds)}
