"""Refits of an acceleration lag next to those with each of the panel's windows."""

from __future__ import annotations

from draglag.gap.fitting.joint import fit_session, gained_nats
from draglag.gap.fitting.state import Term
from draglag.gap.proposing.plain import refit
from draglag.gap.traces.run_data import gather
from draglag.protocol.runs import load_protocol
from draglag.simulation import simulate_session
from draglag.simulation.effects import parse_effect
from draglag.simulation.effects.acceleration_lag import WINDOWS_S, AccelerationLag
from draglag.simulation.effects.acceleration_lag.refits import refits

LAG_S3_MM = 1.2e-5


def test_the_likeliest_window_is_among_the_refits() -> None:
    """One window is chosen without a refit: what that costs is less than a nat."""
    effect = parse_effect(f"acceleration_lag={LAG_S3_MM}")
    session = simulate_session("screen-1", load_protocol("demo"), effects=[effect], seed=4)
    before = fit_session(session, gather(session))
    found = max(gained_nats(before, fit) for fit in refits(session, before, ()) if fit is not None)
    alone = []
    for window_s in WINDOWS_S:
        fit = refit(session, before, [Term(AccelerationLag.id, (LAG_S3_MM, window_s), (LAG_S3_MM,))])
        assert fit is not None
        alone.append(gained_nats(before, fit))
    assert max(alone) - alone[0] > 2, "the usual window is the likeliest: nothing is tested"
    assert found > max(alone) - 1
