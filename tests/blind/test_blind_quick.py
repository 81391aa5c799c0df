"""The quick variant of the benchmark, judged twice.

The promised rates (right name first 95 %, pairs 85 %, false alarms 3 %) are asserted and known to fail: the test that
expects so fails on the day they are met. Until then a change must not lose what is there: the limits are the 0.5 %
quantiles of a binomial with the reached rates, 75 % of single effects named first and 80 % of sessions without effects
left alone (41 sessions, seed 2024).
"""

import os

import pytest
from scipy.stats import binom

from blind import workflow
from blind.benchmark import run_benchmark, table

WHY = workflow.missing()
REACHED = {"recall": 0.75, "false_alarms": 0.20}
LEVEL = 0.005


pytestmark = [
    pytest.mark.blind,
    pytest.mark.skipif(WHY is not None, reason=f"no workflow to judge yet: {WHY}"),
]


@pytest.fixture(scope="module")
def summary():
    # The seed is fixed: the same forty sessions every time, so a failure comes from a change and not from the draw.
    found = run_benchmark(quick=True, jobs=min(2, os.cpu_count() or 1), seed=2024)
    print(table(found))
    return found


@pytest.mark.xfail(strict=True, reason="the promised rates are not met yet: pairs 0 of 3 where 85 % are promised")
def test_the_promised_rates_are_met(summary):
    assert summary["failures"] == []


def test_what_has_been_reached_is_kept(summary):
    named, alarms = summary["recall"], summary["false_alarms"]
    assert named["hits"] >= binom.ppf(LEVEL, named["n"], REACHED["recall"]), summary["failures"]
    assert alarms["hits"] <= binom.ppf(1 - LEVEL, alarms["n"], REACHED["false_alarms"]), summary["failures"]
