"""The budget of systematic errors: what is corrected, what widens the interval."""

from dataclasses import replace

import pytest

from draglag.latency import RunEstimate, with_systematics
from draglag.latency.budget import BUDGET, COVERAGE_FACTOR, Contribution, systematic

ONE = RunEstimate(
    "run-01",
    "circle",
    100.0,
    "kernel",
    speed_mm_s=100.0,
    latency_s=0.05,
    latency_se_s=1e-4,
    latency_ci95_s=(0.0498, 0.0502),
)


def test_a_delay_counts_the_same_at_any_speed_and_a_way_by_speed() -> None:
    budget = (Contribution("delay", delay_s=50e-6, delay_u_s=10e-6), Contribution("way", way_mm=0.01, way_u_mm=0.004))
    slow, fast = systematic(1 / 50.0, budget), systematic(1 / 1000.0, budget)
    assert slow.correction_s == pytest.approx(50e-6 + 0.01 / 50)
    assert fast.correction_s == pytest.approx(50e-6 + 0.01 / 1000)
    assert slow.u_s == pytest.approx(((10e-6) ** 2 + (0.004 / 50) ** 2) ** 0.5)


def test_corrected_latency_is_later_and_both_parts_of_its_interval_are_stated() -> None:
    known = systematic(1 / 100.0)
    found = with_systematics(ONE)
    assert found.latency_s == pytest.approx(0.05 + known.correction_s)
    assert found.systematic_s == pytest.approx(COVERAGE_FACTOR * known.u_s)
    assert found.random_s == pytest.approx(2e-4)
    said = found.to_dict()
    assert said["latency_random_ms"] == pytest.approx(0.2)
    assert said["latency_systematic_ms"] == pytest.approx(1e3 * found.systematic_s)
    assert said["correction_ms"] == pytest.approx(1e3 * known.correction_s)


def test_published_value_stays_and_its_interval_includes_the_correction() -> None:
    found, known = with_systematics(ONE, correct=False), systematic(1 / 100.0)
    assert found.latency_s == 0.05
    assert found.correction_s == 0.0
    assert found.latency_ci95_s is not None
    assert found.latency_ci95_s[1] > 0.0502 + known.correction_s


def test_more_edges_do_not_average_systematic_errors_away() -> None:
    surer = with_systematics(replace(ONE, latency_ci95_s=(0.05 - 1e-6, 0.05 + 1e-6), latency_se_s=5e-7))
    assert surer.latency_ci95_s is not None
    assert surer.latency_ci95_s[1] - surer.latency_ci95_s[0] > 2 * COVERAGE_FACTOR * systematic(1 / 100.0).u_s


def test_each_row_of_the_budget_is_in_the_documentation() -> None:
    from pathlib import Path

    text = (Path(__file__).parents[3] / "docs" / "precision.md").read_text()
    assert [c.name for c in BUDGET if c.name not in text] == []
