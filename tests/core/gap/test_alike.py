"""Sets that are about as probable are compared each at its own refit."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from draglag.gap.posterior import judge


def test_sets_as_probable_as_the_first_are_refitted_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """At the linearisation of a beam that bends a bend of the panel loses, and would never be compared as well."""
    base: Any = SimpleNamespace(name="base")
    fitted: list[str] = []

    def refits(session: Any, before: Any, effect: str, theta: tuple[float, ...]) -> list[Any]:
        assert before is base
        fitted.append(effect)
        return [SimpleNamespace(name=effect)]

    monkeypatch.setattr(judge, "refits_with", refits)
    monkeypatch.setattr(judge, "likeliest", lambda options, base, effect: options[0])
    monkeypatch.setattr(judge, "_loses", lambda fit, before: False)
    shares = {("beam_bow",): 0.46, ("spatial_warp",): 0.45, ("clock_drift",): 0.05, ("clock_drift", "warm_up"): 0.04}
    pool: Any = SimpleNamespace(
        probabilities=lambda: shares, settings_of=lambda names: {}, alone=lambda name: 0.0, best=("beam_bow",)
    )
    found = judge.grown_with_alike(base, {(): base}, pool, ("beam_bow",), set(), set())
    assert list(found) == [("beam_bow",), ("spatial_warp",)]
    assert fitted == ["beam_bow", "spatial_warp"]
    excluded = judge.grown_with_alike(base, {(): base}, pool, ("beam_bow",), {"spatial_warp"}, set())
    assert list(excluded) == [("beam_bow",)]
