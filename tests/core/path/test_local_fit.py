"""Local polynomial fits are those of a textbook's weighted least squares."""

from __future__ import annotations

import numpy as np
import pytest

from draglag.path.local_fit import local_fit


def events(n: int = 300) -> tuple[np.ndarray, np.ndarray]:
    """Unevenly stamped events (n,), (n, 2) of a circle with noise."""
    rng = np.random.default_rng(5)
    t_s = np.cumsum(rng.uniform(0.002, 0.006, n))
    circle = 60 * np.column_stack([np.cos(5 * t_s), np.sin(5 * t_s)])
    return t_s, circle + rng.normal(0, 0.05, (n, 2))


@pytest.mark.parametrize(("degree", "roundness"), [(3, 1), (2, 3)])
@pytest.mark.parametrize("times", [7, 900])  # fewer and more than are worked on at once
def test_positions_and_derivatives_are_those_of_weighted_least_squares(degree: int, roundness: int, times: int) -> None:
    t_s, xy_mm = events()
    at_s = np.linspace(t_s[20], t_s[-20], times)
    half_s = np.linspace(0.03, 0.06, times)
    found = local_fit(t_s, xy_mm, at_s, half_s, degree, roundness)
    assert found.ok.all()
    for k in range(0, times, max(times // 7, 1)):
        u = (t_s - at_s[k]) / half_s[k]
        inside = np.abs(u) < 1
        root_weight = (1 - u[inside] ** 2) ** (0.5 * roundness)
        c = np.polyfit(t_s[inside] - at_s[k], xy_mm[inside], degree, w=root_weight)[::-1]
        np.testing.assert_allclose(found.xy_mm[k], c[0], rtol=1e-8)
        np.testing.assert_allclose(found.v_mm_s[k], c[1], rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(found.a_mm_s2[k], 2 * c[2], rtol=1e-6, atol=1e-4)


def test_the_contributions_of_the_events_make_up_each_fit() -> None:
    t_s, xy_mm = events()
    found = local_fit(t_s, xy_mm, np.linspace(t_s[20], t_s[-20], 40), 0.05)
    for weights, values in (
        (found.by_event.position, found.xy_mm),
        (found.by_event.velocity, found.v_mm_s),
        (found.by_event.acceleration, found.a_mm_s2),
    ):
        np.testing.assert_allclose(found.rows(weights, t_s.size) @ xy_mm, values, rtol=1e-7, atol=1e-6)
    np.testing.assert_allclose(found.gain, np.sum(found.by_event.position**2, axis=1))


def test_the_noise_of_a_fit_is_what_its_gain_says() -> None:
    """Of 400 draws a variance is known to 5 %: four times that is allowed."""
    t_s, _ = events(60)
    at_s, rng = t_s[[30]], np.random.default_rng(2)
    drawn = np.array([local_fit(t_s, rng.normal(size=(60, 2)), at_s, 0.05).xy_mm[0] for _ in range(400)])
    gain = local_fit(t_s, np.zeros((60, 2)), at_s, 0.05).gain[0]
    assert drawn.var() == pytest.approx(gain, rel=0.2)


@pytest.mark.parametrize("left_out", [slice(0, 150), slice(120, 200)])
def test_where_events_lie_on_one_side_only_a_fit_is_not_ok_and_finite(left_out: slice) -> None:
    t_s, xy_mm = events()
    at_s = t_s[[100, 122, 149, 198]]
    t_s, xy_mm = np.delete(t_s, left_out), np.delete(xy_mm, left_out, axis=0)
    found = local_fit(t_s, xy_mm, at_s, 0.02)
    lacking = np.array(
        [np.sum((t_s > t) & (t_s < t + 0.02)) < 2 or np.sum((t_s < t) & (t_s > t - 0.02)) < 2 for t in at_s]
    )
    assert lacking.any()
    assert not found.ok[lacking].any()
    assert np.isfinite(found.xy_mm).all()


def test_events_at_two_times_only_give_finite_values() -> None:
    t_s = np.repeat([0.99, 1.01], 4)
    found = local_fit(t_s, np.ones((8, 2)), np.array([1.0]), 0.05)
    assert np.isfinite([*found.xy_mm[0], *found.v_mm_s[0]]).all()
    np.testing.assert_allclose(found.xy_mm[0], 1.0, atol=0.02)  # rounding over the ridge: 100 × 2e-16 / 1e-12
