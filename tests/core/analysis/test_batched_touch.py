"""Touch events that come in batches have the latency of the last of each: an analysis says so."""

import numpy as np
import pytest

from core.sound_sessions import recorded
from draglag.analysis import analyze
from draglag.protocol.runs import load_protocol
from draglag.simulation import simulate_session
from draglag.simulation.effects import parse_effect


@pytest.mark.parametrize("size", [2, 3, 5])
def test_how_many_come_at_a_time_and_how_long_the_first_waits(size: int) -> None:
    effect = parse_effect(f"frame_batching={size}")
    session = simulate_session("screen-1", load_protocol("demo"), effects=[effect], seed=5)
    frame_ms = 1e3 * float(np.median([np.ptp(run.touch.t_s) / (run.touch.t_s.size - 1) for run in session.runs]))
    (said,) = [text for text in analyze(session).warnings if "at a time" in text]
    assert f"arrive {size} at a time" in said
    wait_ms = float(said.split(" ms later")[0].split()[-1])
    assert wait_ms == pytest.approx((size - 1) * frame_ms, abs=0.1 + 0.02 * size * frame_ms)


def test_single_events_are_no_batches() -> None:
    assert [text for text in analyze(recorded()).warnings if "at a time" in text] == []
