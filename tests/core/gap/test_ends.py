"""What edges leave open of the end of the curve, beyond the fastest run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from draglag.gap.by_taps import clock_offset
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
    """Circles of 60 to 400 mm/s on this law, with taps."""
    demo = load_protocol("demo")
    speeds = np.geomspace(60.0, 400.0, 10).round()
    one = next(run for run in demo.runs if run.kind == "circle")
    runs = tuple(one.model_copy(update={"speed_mm_s": float(v), "duration_s": 25.0}) for v in speeds)
    protocol = demo.model_copy(update={"runs": runs})
    return simulate_session(replace(rig_for_screen("screen-1"), law=law), protocol, seed=seed)


def interval_ms(fit: Fit) -> tuple[float, float]:
    """95 % of the ends' probability, to half a millisecond, the step between them."""
    ends_s, weights = possible_ends(fit)
    low, high = np.interp([0.025, 0.975], np.cumsum(weights), ends_s)
    return 1e3 * float(low) - 0.5, 1e3 * float(high) + 0.5


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_curve_that_still_falls_at_the_fastest_run_may_end_far_below(seed: int) -> None:
    session = circles(SLOW, seed)
    fit = fit_session(session, gather(session))
    low, high = interval_ms(fit)
    assert low < SLOW.a7_ms < high
    assert high - low > 10.0
    offset = clock_offset(session, fit)
    assert offset is not None
    assert offset.probability < 0.5
    assert offset.ci95_s[0] < 0 < offset.ci95_s[1]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_curve_that_has_fallen_ends_where_it_is(seed: int) -> None:
    session = circles(FALLEN, seed)
    low, high = interval_ms(fit_session(session, gather(session)))
    assert low < FALLEN.a7_ms < high
    assert high - low < 6.0


@pytest.mark.parametrize(("law", "offset"), [(SLOW, False), (FALLEN, True)])
def test_of_another_form_a_curve_falls_on_as_it_fell_last(law: LatencyLaw, offset: bool) -> None:
    session = circles(law, 4)
    assert session.taps is not None
    later = replace(session, taps=replace(session.taps, registered_s=session.taps.registered_s - 0.012))
    found = clock_offset(later, fit_session(session, gather(session)), p_other=1.0)
    assert found is not None
    assert (found.probability > 0.5) is offset
