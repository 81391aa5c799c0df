"""Where a latency law is steep, a tremor of 0.05 mm scatters the latency of every edge by milliseconds."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.signal import butter, sosfreqz

from bench.rigs import circle_run, rig_with_latency
from draglag.latency import RunEstimate, estimate_run
from draglag.latency.estimate import prepare
from draglag.latency.track import track_of
from draglag.latency.tremor import Tremor
from draglag.recording import FloatArray
from draglag.simulation import Human, RunTruth, rig_for_screen

SPEEDS_MM_S = (54.0, 67.0, 83.0, 103.0)
SEEDS = 40
RUN_SCATTER_S = 3e-4
STEEP = replace(
    rig_for_screen("screen-1"), contact_loss_per_s=0.0, sensor_response_s=0.0, run_latency_sd_s=RUN_SCATTER_S
)


@cache
def steep_runs() -> tuple[tuple[RunEstimate, RunTruth], ...]:
    """40 s each, as in the paper's sweep: 28 to 54 edges, on Screen 1, whose law falls by 0.7 to 1.4 ms per mm/s."""
    out = []
    for speed in SPEEDS_MM_S:
        for seed in range(SEEDS):
            run, truth, _, _ = circle_run(speed, seed, STEEP, None, 50.0, 40 * speed / (2 * math.pi * 50.0))
            out.append((estimate_run(run, 7.0), truth))
    return tuple(out)


def true_latency_s(found: RunEstimate, truth: RunTruth) -> float:
    """Mean over the edges that the estimate has: what came before the stylus touched is none of them."""
    assert found.alignment is not None
    near = np.abs(truth.edge_s[:, None] - found.alignment.edge_t_s).argmin(0)
    return float(truth.latency_s[near].mean())


def test_a_runs_interval_holds_the_mean_latency_over_its_edges() -> None:
    z, held = [], 0
    for found, truth in steep_runs():
        assert found.latency_s is not None
        assert found.latency_se_s is not None
        assert found.latency_ci95_s is not None
        true_s = true_latency_s(found, truth)
        z.append((found.latency_s - true_s) / found.latency_se_s)
        held += found.latency_ci95_s[0] <= true_s <= found.latency_ci95_s[1]
    n = len(z)
    # Four standard errors of a share of 0.95, and of a root mean square, of so many runs.
    assert held >= (0.95 - 4 * math.sqrt(0.95 * 0.05 / n)) * n
    assert np.sqrt(np.mean(np.square(z))) < 1 + 4 / math.sqrt(2 * n)


def test_runs_lie_on_the_law_by_their_error_at_the_mean_speed() -> None:
    def law_s(speed_mm_s: float | FloatArray) -> FloatArray:
        return np.asarray(STEEP.law.latency_s(np.asarray(speed_mm_s, float)))

    z = []
    for found, _ in steep_runs():
        assert found.latency_s is not None
        assert found.curve_se_s is not None
        speed, varies = found.speed_mm_s or math.nan, found.speed_sd_mm_s or 0.0
        expected_s = float(law_s(np.array([speed - varies, speed + varies])).mean())
        slope = float(law_s(speed + 1.0) - law_s(speed - 1.0)) / 2
        spread_s = math.hypot(found.curve_se_s, RUN_SCATTER_S, slope * (found.speed_se_mm_s or 0.0))
        z.append((found.latency_s - expected_s) / spread_s)
    assert abs(np.sqrt(np.mean(np.square(z))) - 1) < 4 / math.sqrt(2 * len(z))


@pytest.mark.parametrize("slow_share", [0.0, 0.2, 0.4])
def test_a_digitisers_slow_noise_is_not_taken_off_the_tremor(slow_share: float) -> None:
    """Noise that falls with frequency lies below straight lines over the band of tremor."""
    human = Human()
    f_hz, gain = sosfreqz(butter(2, (8.0, 12.0), "band", fs=1000.0, output="sos"), 20000, fs=1000.0)
    power = np.abs(gain) ** 4
    speed2 = human.tremor_mm**2 * float(((2 * np.pi * f_hz) ** 2 * power).sum() / power.sum())
    rig = rig_with_latency(0.08, noise_slow_share=slow_share)
    found = []
    for seed in range(24):
        run, _, _, _ = circle_run(80.0, seed, rig, human, 30.0, 18.0)
        tremor = track_of(prepare(run, 7.0)).tremor
        assert tremor is not None
        found.append(tremor.speed2)
    # Noise over 5 Hz for 42 s leaves each of them open by about 18 %.
    assert np.mean(found) == pytest.approx(speed2, rel=4 * 0.18 / math.sqrt(24))


def test_edges_that_meet_the_same_phase_of_the_tremor_do_not_average_it_away() -> None:
    lag_s = np.arange(400) / 110
    tremor = Tremor(0.0, 1 / 110, np.zeros((2, 2)), np.zeros(400), np.cos(2 * np.pi * 10 * lag_s), 9.0)
    ahead = np.array([[0.0, 1.0]] * 2)
    # Straight lines between eleven points a period are true to 4 %.
    assert tremor.mean_speed2(np.array([5.0, 5.1]), ahead) == pytest.approx(9.0, rel=0.05)
    assert tremor.mean_speed2(np.array([5.0, 5.05]), ahead) < 0.5 * 9.0 / 2
    assert tremor.mean_speed2(np.array([5.0, 5.05]), ahead * [[1], [-1]]) == pytest.approx(9.0, rel=0.05)
    assert tremor.mean_speed2(np.array([5.0, 15.0]), ahead) == pytest.approx(9.0 / 2)
