"""Sessions that repeat each speed: many edges show shapes far below the size of interest."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from draglag.gap import close_gap
from draglag.gap.posterior import linear
from draglag.gap.posterior.members import Member, of_unit_rms
from draglag.protocol.runs import load_protocol
from draglag.simulation import simulate_session
from draglag.simulation.effects import parse_effect

REPEATS = 3


def test_a_wider_shadow_is_named_where_every_speed_is_repeated() -> None:
    """Of 4000 edges, what is left of two columns of a millimetre that nearly cancel is no explanation."""
    demo = load_protocol("demo")
    runs = tuple(run.model_copy(update={"repeats": REPEATS}) for run in demo.runs)
    effect = parse_effect("beam_width=0.8")
    found = close_gap(simulate_session("screen-1", demo.model_copy(update={"runs": runs}), effects=[effect], seed=4))
    assert found.verdict == "explained"
    assert [step.effect for step in found.steps] == ["beam_width"]
    low_mm, high_mm = found.steps[0].parameters["extra_mm"][1]
    assert low_mm < 0.8 < high_mm


def test_the_difference_of_two_columns_is_a_direction_of_the_tolerance(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(3)
    one, other = (of_unit_rms(rng.standard_normal((400, 1))) for _ in range(2))
    members = [Member("one", (), one, 0.0), Member("alike", (), one + 0.02 * other, 0.0)]
    monkeypatch.setattr(linear, "smooth_columns", lambda fit: {})
    fit: Any = SimpleNamespace()
    tolerated, singular = linear.tolerance_of(fit, members)
    sizes_mm, left, _, _ = np.linalg.lstsq(tolerated, other[:, 0], rcond=None)
    assert left[0] < 1e-9 * other.size
    assert np.linalg.norm(sizes_mm) == pytest.approx(1.0)
    # Both columns have 1 mm along the first direction, and 0.01 mm along the second.
    np.testing.assert_allclose(singular, [np.sqrt(2), 0.01 * np.sqrt(2)], rtol=0.05)
