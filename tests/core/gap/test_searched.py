"""Latencies are searched where the clocks have drifted to."""

from __future__ import annotations

import numpy as np
import pytest

from core.gap.test_fit import short_demo
from draglag.gap.traces.searched import searched
from draglag.recording import FloatArray, Session
from draglag.simulation import simulate_session
from draglag.simulation.effects import parse_effect

REST_S = 460.0  # between runs: the session takes 95 minutes, in which 60 ppm are 0.34 s


def afternoon(*effects: str) -> Session:
    plan = short_demo().model_copy(update={"rest_s": REST_S})
    return simulate_session("screen-1", plan, effects=[parse_effect(e) for e in effects], seed=4)


def latencies_s(session: Session) -> FloatArray:
    found = [estimate.latency_s for _, estimate in searched(session)]
    return np.array([np.nan if latency_s is None else latency_s for latency_s in found])


@pytest.mark.parametrize("drift_ppm", [60, -60])
def test_runs_are_found_after_the_clocks_have_drifted_out_of_a_window(drift_ppm: int) -> None:
    sound, drifted = afternoon(), afternoon(f"clock_drift={drift_ppm}")
    before_s, after_s = latencies_s(sound), latencies_s(drifted)
    start_s = np.array([run.start_s for run in sound.runs])
    # The same hand and noise: what differs is the drift since the session began, and within a run of 15 s one ms.
    np.testing.assert_allclose(before_s - after_s, 1e-6 * drift_ppm * start_s, atol=2e-3)
    assert np.ptp(after_s - before_s) > 0.3
