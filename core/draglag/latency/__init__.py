"""Latency of one run: as published (Eq. 1–2), and by joint maximum likelihood."""

from draglag.latency.budget import with_systematics
from draglag.latency.estimate import RunEstimate
from draglag.latency.on_clock import estimate_on_clock
from draglag.latency.run import estimate_run

__all__ = ["RunEstimate", "estimate_on_clock", "estimate_run", "with_systematics"]
