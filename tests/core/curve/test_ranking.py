"""Many curves in order: the right one, with intervals that hold the truth as often as they say."""

from __future__ import annotations

import numpy as np
import pytest

from draglag.curve import CurveFit, CurvePoints, fit_form
from draglag.curve.ranking import ranking
from draglag.errors import EstimateError
from draglag.provenance import Source
from draglag.reproduction.drawings import comparison_page

SPEED = np.array([50.0, 80, 130, 200, 320, 500, 700, 900])
SE_S = 1e-3


def curve(latency_ms: float, rng: np.random.Generator | None = None, speed: np.ndarray = SPEED) -> CurveFit:
    """A constant latency measured at eight speeds, with or without noise of 1 ms."""
    noise = np.zeros(speed.size) if rng is None else SE_S * rng.standard_normal(speed.size)
    return fit_form(CurvePoints(speed, 1e-3 * latency_ms + noise, np.full(speed.size, SE_S)), "constant")


def test_curves_far_apart_have_the_places_they_have() -> None:
    found = ranking([("slow", curve(90)), ("fast", curve(30)), ("middle", curve(60))])
    assert [place.name for place in found.places] == ["fast", "middle", "slow"]
    assert [(p.rank, p.rank_low, p.rank_high) for p in found.places] == [(1, 1, 1), (2, 2, 2), (3, 3, 3)]
    assert found.places[0].mean_s == pytest.approx(0.030, abs=1e-6)
    assert found.speed_range_mm_s == (50.0, 900.0)


def test_curves_that_cannot_be_distinguished_share_their_ranks() -> None:
    found = ranking([("a", curve(50.0)), ("b", curve(50.1)), ("c", curve(80.0))])
    assert [(p.rank_low, p.rank_high) for p in found.places] == [(1, 2), (1, 2), (3, 3)]


def test_intervals_hold_the_true_mean_as_often_as_they_say() -> None:
    rng = np.random.default_rng(3)
    inside = [
        place.low_s <= 0.05 <= place.high_s
        for _ in range(20)
        for place in ranking([(str(k), curve(50.0, rng)) for k in range(20)]).places
    ]
    # 400 intervals: 95 % ± 4 standard errors.
    assert 0.905 < np.mean(inside) < 0.995


def test_only_speeds_that_all_share_are_compared() -> None:
    found = ranking([("a", curve(50)), ("b", curve(60, speed=np.linspace(300, 2000, 8)))])
    assert found.speed_range_mm_s == (300.0, 900.0)
    with pytest.raises(EstimateError, match="no speed at which all"):
        ranking([("a", curve(50)), ("b", curve(60, speed=np.linspace(1000, 2000, 8)))])


def test_the_page_of_fifty_curves_ranks_them() -> None:
    pytest.importorskip("matplotlib")
    rng = np.random.default_rng(1)
    fifty = [(f"screen {k:02}", curve(40 + k, rng), Source(f"s{k}", "", False)) for k in range(50)]
    page = comparison_page(fifty, ranking([(name, one) for name, one, _ in fifty]))
    assert page.count("<img ") == 2
    assert page.index("screen 00</td>") < page.index("screen 49</td>")
    assert page.count("<tr>") == 51
