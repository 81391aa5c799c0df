"""Numerics of our own are scipy's, whose import costs a command more than they do."""

from __future__ import annotations

import subprocess
import sys

import pytest
from scipy.fft import next_fast_len
from scipy.special import stdtrit

from draglag.numerics import fast_length, student_t


@pytest.mark.parametrize("p", [0.75, 0.84, 0.95, 0.975, 0.995])
@pytest.mark.parametrize(("dof", "close"), [(1, 1e-9), (1.4, 1e-3), (2, 1e-5), (4.5, 1e-5), (20, 1e-5), (3e4, 1e-5)])
def test_quantiles_are_those_of_students_t(dof: float, close: float, p: float) -> None:
    assert student_t(dof, p) == pytest.approx(float(stdtrit(dof, p)), rel=close)


def test_a_fast_length_is_the_next_product_of_two_three_and_five() -> None:
    lengths = [*range(1, 3000), 2**20 - 1, 2**20 + 1, 1_234_567]
    assert [fast_length(n) for n in lengths] == [next_fast_len(n, real=True) for n in lengths]


def test_an_analysis_imports_of_scipy_what_estimates_need() -> None:
    heavy = "{'scipy.fft', 'scipy.special', 'scipy.sparse', 'scipy.optimize', 'scipy.stats', 'scipy.signal'}"
    code = f"import sys, draglag.analysis; print(sorted({heavy} & set(sys.modules)))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"
