"""The difference of taps from the curve's end, and what the runs leave open of that end."""

from __future__ import annotations

import numpy as np
import pytest

from draglag.gap.by_taps import Ends

MS = 1e-3


def ends(open_s: float) -> Ends:
    """An end that the runs leave open by a standard deviation; releases are known to 1 ms."""
    at_s = np.arange(-50, 50.1, 0.5) * MS
    likely = np.exp(-0.5 * (at_s / max(open_s, 0.1 * MS)) ** 2)
    return Ends(at_s, likely / likely.sum(), MS**2)


def test_releases_far_off_a_well_known_end_are_an_offset_of_that_size() -> None:
    found = ends(0.0).offset(9 * MS)
    assert found.probability > 0.9
    assert found.value_s == pytest.approx(9 * MS, abs=1e-5)
    assert found.ci95_s == pytest.approx((9 * MS - 1.96 * MS, 9 * MS + 1.96 * MS), abs=1e-4)


def test_where_the_runs_leave_the_end_open_by_as_much_they_are_none() -> None:
    found = ends(8 * MS).offset(9 * MS)
    assert found.probability < 0.1
    # The end's variance of 8² and the offset's own of 10² share what is seen to 1 ms.
    middle, sd = 9 * 101 / 165, np.sqrt(64 * 101 / 165 + 1)
    assert found.value_s == pytest.approx(middle * MS, abs=1e-4)
    assert found.ci95_s == pytest.approx(((middle - 1.96 * sd) * MS, (middle + 1.96 * sd) * MS), abs=2e-4)


def test_nor_are_they_where_the_curve_may_end_anywhere() -> None:
    at_s = np.arange(-20, 40.1, 0.5) * MS
    assert Ends(at_s, np.full(at_s.size, 1 / at_s.size), MS**2).offset(9 * MS).probability < 0.1


@pytest.mark.parametrize("off_s", [0.5, -2.0])
def test_clocks_that_are_off_by_a_second_are_reported_by_as_much(off_s: float) -> None:
    found = ends(1 * MS).offset(off_s)
    assert found.probability > 0.9
    assert found.value_s == pytest.approx(off_s, abs=1e-4)
    reach_s = 1.96 * np.sqrt(2) * MS  # the end and the releases are known to 1 ms each
    assert found.ci95_s == pytest.approx((off_s - reach_s, off_s + reach_s), abs=1e-4)
