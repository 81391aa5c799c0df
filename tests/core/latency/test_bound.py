"""The bound's covariance is that of Gaussian conditioning, whatever the number of events."""

import numpy as np
import pytest

from draglag.latency.bound import _posterior


@pytest.mark.parametrize("events", [20, 200])
def test_few_and_many_events_leave_what_gaussian_conditioning_leaves(events: int) -> None:
    rng = np.random.default_rng(1)
    edge_f, event_f = rng.standard_normal((5, 60)), rng.standard_normal((events, 60))
    noise = 0.3 * np.eye(events) + 0.1
    expected = edge_f @ edge_f.T - edge_f @ event_f.T @ np.linalg.inv(event_f @ event_f.T + noise) @ event_f @ edge_f.T
    assert _posterior(edge_f, event_f, noise) == pytest.approx(expected, rel=1e-9, abs=1e-9)
