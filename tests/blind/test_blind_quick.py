"""The quick variant of the benchmark: 41 sessions, seed 2024, against the promised rates and their binomial limits."""

import os

import pytest

from blind import workflow
from blind.benchmark import run_benchmark, table

WHY = workflow.missing()

pytestmark = [
    pytest.mark.blind,
    pytest.mark.skipif(WHY is not None, reason=f"no workflow to judge yet: {WHY}"),
]


@pytest.fixture(scope="module")
def summary():
    # The seed is fixed: the same forty sessions every time, so a failure comes from a change and not from the draw.
    found = run_benchmark(quick=True, world="plain", jobs=min(2, os.cpu_count() or 1), seed=2024)
    print(table(found))
    return found


def test_the_promised_rates_are_met(summary):
    assert summary["failures"] == []
