"""The quick variant of the benchmark: fails when recall or false alarms fall outside their binomial limits."""

import os

import pytest

from blind import workflow
from blind.benchmark import run_benchmark, table

WHY = workflow.missing()


@pytest.mark.blind
@pytest.mark.skipif(WHY is not None, reason=f"no workflow to judge yet: {WHY}")
def test_quick_benchmark():
    # The seed is fixed: the same forty sessions every time, so a failure comes from a change and not from the draw.
    summary = run_benchmark(quick=True, jobs=min(2, os.cpu_count() or 1), seed=2024)
    print(table(summary))
    assert summary["failures"] == []
