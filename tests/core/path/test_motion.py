"""Windows and noise of local fits, where the noise is known."""

from __future__ import annotations

import numpy as np
import pytest

from draglag.path.motion import best_half_width_s

NOISE_MM = 0.1
OMEGA = 2 * np.pi * 0.8


@pytest.mark.parametrize("every", [7, 30, 1000])
def test_the_noise_is_known_although_every_few_events_are_missing(every: int) -> None:
    """A loop at 100 Hz asks a panel of 85 Hz: without the positions that it repeats, every seventh tick is empty."""
    tick = np.arange(2000)
    t_s = 0.01 * tick[tick % every > 0]
    way_mm = 50 * np.column_stack([np.cos(OMEGA * t_s), np.sin(OMEGA * t_s)])
    noise_mm = NOISE_MM * np.random.default_rng(3).standard_normal(way_mm.shape)
    _, found_mm = best_half_width_s(t_s, way_mm + noise_mm, t_s[::50])
    assert found_mm == pytest.approx(NOISE_MM, abs=4 * NOISE_MM / np.sqrt(2 * 600))  # numbers of events near those


@pytest.mark.parametrize("n", [2, 4, 7, 20])
def test_a_trace_too_short_has_no_noise(n: int) -> None:
    t_s = 0.01 * np.arange(n)
    half_s, found_mm = best_half_width_s(t_s, np.column_stack([t_s, t_s]), t_s)
    assert half_s == pytest.approx(0.035)
    assert np.isnan(found_mm)
