"""Latency of one run: Eq. 1–2 as the paper has them, and the efficient estimator (joint maximum likelihood)."""

from draglag.latency.estimate import RunEstimate, estimate_run

__all__ = ["RunEstimate", "estimate_run"]
