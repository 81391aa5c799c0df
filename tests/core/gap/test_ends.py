"""What edges leave open of the end of the curve, beyond the fastest run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from draglag.gap.by_taps import Offset, clock_offset
from draglag.gap.ends import possible_ends
from draglag.gap.fitting.joint import Fit, fit_session
from draglag.gap.traces.run_data import gather
from draglag.protocol.runs import load_protocol
from draglag.recording import Session
from draglag.simulation import rig_for_screen, simulate_session
from draglag.simulation.law import LatencyLaw

SLOW = LatencyLaw(49.5, 0.0015, 104.3, 0.0072, 17.8)  # of a session of a foreign generator
FALLEN = LatencyLaw(49.5, 0.025, 104.3, 0.05, 37.8)


def circles(law: LatencyLaw, seed: int) -> Session:
    """Seven circles of 60 to 400 mm/s on this law, with taps."""
    demo = load_protocol("demo")
    speeds = np.geomspace(60.0, 400.0, 7).round()
    one = next(run for run in demo.runs if run.kind == "circle")
    runs = (one.model_copy(update={"speeds_mm_s": tuple(map(float, speeds)), "duration_s": 25.0}),)
    protocol = demo.model_copy(update={"runs": runs})
    return simulate_session(replace(rig_for_screen("screen-1"), law=law, run_latency_sd_s=0.0), protocol, seed=seed)


@pytest.fixture(scope="module")
def slow() -> tuple[Session, Fit]:
    session = circles(SLOW, 1)
    return session, fit_session(session, gather(session))


@pytest.fixture(scope="module")
def fallen() -> tuple[Session, Fit]:
    session = circles(FALLEN, 1)
    return session, fit_session(session, gather(session))


def interval_ms(fit: Fit) -> tuple[float, float]:
    """95 % of the ends' probability, to half a millisecond, the step between them."""
    ends_s, weights = possible_ends(fit)
    low, high = np.interp([0.025, 0.975], np.cumsum(weights), ends_s)
    return 1e3 * float(low) - 0.5, 1e3 * float(high) + 0.5


def offset_of(session: Session, fit: Fit, tap_latency_ms: float, p_other: float = 0.0) -> Offset:
    """Offset that releases show which come so late, with the scatter of the simulated ones."""
    assert session.taps is not None
    late_s = session.taps.registered_s - session.taps.physical_s
    late_s += 1e-3 * tap_latency_ms - float(np.median(late_s[session.taps.down == 0]))
    taps = replace(session.taps, registered_s=session.taps.physical_s + late_s)
    found = clock_offset(replace(session, taps=taps), fit, p_other=p_other)
    assert found is not None
    return found


def test_a_curve_that_still_falls_at_the_fastest_run_may_end_far_below(slow: tuple[Session, Fit]) -> None:
    low, high = interval_ms(slow[1])
    assert low < SLOW.a7_ms < high
    assert high - low > 10.0
    offset = offset_of(*slow, SLOW.a7_ms)
    assert offset.probability < 0.5
    assert offset.ci95_s[0] < 0 < offset.ci95_s[1]


def test_a_curve_that_has_fallen_ends_where_it_is(fallen: tuple[Session, Fit]) -> None:
    low, high = interval_ms(fallen[1])
    assert low < FALLEN.a7_ms < high
    assert high - low < 6.0
    assert offset_of(*fallen, FALLEN.a7_ms).probability < 0.5
    assert offset_of(*fallen, FALLEN.a7_ms - 12).probability > 0.5


def test_of_another_form_a_curve_falls_on_as_it_fell_last(
    slow: tuple[Session, Fit], fallen: tuple[Session, Fit]
) -> None:
    assert offset_of(*slow, SLOW.a7_ms, p_other=1.0).probability < 0.5
    assert offset_of(*fallen, FALLEN.a7_ms - 12, p_other=1.0).probability > 0.5


def test_a_curve_below_zero_is_that_of_a_clock_that_is_off(fallen: tuple[Session, Fit]) -> None:
    session, fit = fallen
    law = replace(fit.law, a7_s=fit.law.a7_s - 0.05)
    offset = offset_of(session, replace(fit, law=law), FALLEN.a7_ms)
    assert offset.probability > 0.5
    assert offset.ci95_s[0] < 0.05 < offset.ci95_s[1]
