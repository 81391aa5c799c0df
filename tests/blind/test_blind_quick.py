"""The quick variant of the benchmark: fails when recall or false alarms fall below what has been reached.

``draglag blind`` judges the promised rates (right name first 95 %, pairs 85 %, false alarms 3 %) and exits 1 while
they are not met; here a change must not lose what is there. The limits are the 0.5 % quantiles of a binomial with the
reached rates: 75 % of single effects named first, 80 % of sessions without effects left alone (41 sessions, seed 2024).
"""

import os

import pytest
from scipy.stats import binom

from blind import workflow
from blind.benchmark import run_benchmark, table

WHY = workflow.missing()
REACHED = {"recall": 0.75, "false_alarms": 0.20}
LEVEL = 0.005


@pytest.mark.blind
@pytest.mark.skipif(WHY is not None, reason=f"no workflow to judge yet: {WHY}")
def test_quick_benchmark():
    # The seed is fixed: the same forty sessions every time, so a failure comes from a change and not from the draw.
    summary = run_benchmark(quick=True, jobs=min(2, os.cpu_count() or 1), seed=2024)
    print(table(summary))
    named, alarms = summary["recall"], summary["false_alarms"]
    assert named["hits"] >= binom.ppf(LEVEL, named["n"], REACHED["recall"]), summary["failures"]
    assert alarms["hits"] <= binom.ppf(1 - LEVEL, alarms["n"], REACHED["false_alarms"]), summary["failures"]
