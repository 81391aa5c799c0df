"""Estimators of a run's latency by name."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from numbers import Real
from typing import cast

from draglag.errors import DraglagError, EstimateError
from draglag.latency.efficient import estimate_efficient
from draglag.latency.estimate import Prepared, RunEstimate
from draglag.latency.paper import estimate_paper
from draglag.messages import message
from draglag.system.plugins import brought

GROUP = "draglag.estimators"
Estimator = Callable[[Prepared, RunEstimate, tuple[float, float]], RunEstimate]
"""(prepared run, estimate without figures, searched latencies in s) → estimate with figures."""

OWN: dict[str, Estimator] = {"efficient": estimate_efficient, "paper": estimate_paper}


def estimator_names() -> list[str]:
    """Names of all estimators."""
    return [*OWN, *_of_other_packages()]


def estimator_of(name: str) -> Estimator:
    """The estimator of that name. Raises EstimateError."""
    if name in OWN:
        return OWN[name]
    others = _of_other_packages()
    if name not in others:
        raise EstimateError(
            message("unknown estimator {name}", name=repr(name)),
            message("Use one of {names}", names=", ".join([*OWN, *others])),
        )
    return _guarded(name, others[name])


@cache
def _of_other_packages() -> dict[str, Estimator]:
    return {name: cast(Estimator, one) for name, one in brought(GROUP, "estimator", _problem)}


def _problem(name: str, one: object) -> str:
    if not re.fullmatch(r"[a-z][a-z0-9_-]*", name):
        return "its name is not of lower-case letters, digits, underscores and dashes"
    if name in OWN:
        return "its name is taken"
    return "" if callable(one) else "it is no function"


def _guarded(name: str, one: Estimator) -> Estimator:
    def estimate(ready: Prepared, blank: RunEstimate, window_s: tuple[float, float]) -> RunEstimate:
        try:
            found: object = one(ready, blank, window_s)
        except DraglagError:
            raise
        except Exception as error:  # whatever a stranger's code does
            problem = f"{type(error).__name__}: {error}"
        else:
            if isinstance(found, RunEstimate) and found.id == blank.id:
                return _with_known_latency(found)
            problem = message("it returned a {kind}, not the RunEstimate of this run", kind=type(found).__name__)
        raise EstimateError(
            message("{run}: the estimator {name} failed ({problem})", run=blank.id, name=name, problem=problem),
            "Ask who made its package",
        )

    return estimate


def _with_known_latency(found: RunEstimate) -> RunEstimate:
    """The estimate without its latency where that, or its speed, is no number."""
    if found.latency_s is None or (_finite(found.latency_s) and _finite(found.speed_mm_s)):
        return found
    flags = found.flags if "unidentifiable" in found.flags else (*found.flags, "unidentifiable")
    return replace(
        found,
        speed_mm_s=found.speed_mm_s if _finite(found.speed_mm_s) else None,
        latency_s=None,
        latency_se_s=None,
        se_at_speed_s=None,
        latency_ci95_s=None,
        flags=flags,
    )


def _finite(value: object) -> bool:
    return isinstance(value, Real) and math.isfinite(value)
