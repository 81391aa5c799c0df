"""What the session simulated again disagrees with, and what lies below the size of interest."""

from __future__ import annotations

from dataclasses import replace

import pytest

from core import sound_sessions
from draglag.gap import close_gap
from draglag.gap.check import compared_statistics
from draglag.gap.constants import REPEATS_AS_OFTEN
from draglag.gap.replaying.replay import replay
from draglag.gap.results import Tolerated
from draglag.gap.streams.stamps import first_of_repeats
from draglag.protocol.runs import load_protocol
from draglag.simulation import simulate_session
from draglag.simulation.effects import parse_effect
from draglag.simulation.rig import rig_for_screen


@pytest.mark.parametrize(("more_mm", "agrees"), [(0.06, True), (-0.06, True), (0.14, False), (-0.14, False)])
def test_a_width_disagrees_where_it_moves_edges_by_the_size_of_interest(more_mm: float, agrees: bool) -> None:
    """0.05 mm of an edge are 0.1 mm of a width; its mean over the runs is known to 0.01 mm."""
    shadow = parse_effect(f"beam_width={more_mm}")
    session = simulate_session("screen-1", load_protocol("demo"), effects=[shadow], seed=5)
    last = close_gap(session, max_effects=0).last
    assert last is not None
    found = {one.name: one for one in compared_statistics(session, replay(session, last, {}))}
    width = found["stylus width"]
    assert width.agrees is agrees
    assert width.measured - width.simulated == pytest.approx(more_mm, abs=0.04)


def test_one_run_of_a_wrong_width_disagrees_with_no_simulation() -> None:
    """A latency that steps between the edges of one stroke moves its width by millimetres, and that of no other run."""
    session = simulate_session("screen-1", load_protocol("demo"), seed=5)
    last = close_gap(session, max_effects=0).last
    assert last is not None
    again = replay(session, last, {})
    for off, agrees in ((1, True), (len(again.runs), False)):
        runs = [
            replace(one, measured=replace(one.measured, stylus_diameter_mm=3.0)) if k < off and one.measured else one
            for k, one in enumerate(again.runs)
        ]
        found = {one.name: one for one in compared_statistics(session, replace(again, runs=tuple(runs)))}
        assert found["stylus width"].agrees is agrees


@pytest.mark.parametrize(("sent", "agrees"), [(True, True), (False, False)])
def test_frames_that_a_kernel_leaves_out_are_compared_as_repeats(sent: bool, agrees: bool) -> None:
    """A simulated deadband repeats positions: frames have to be missing as often where none repeats."""
    panel = replace(rig_for_screen("screen-1"), resolution_mm=0.0)
    held, plain = (
        simulate_session(panel, sound_sessions.brief_protocol(), effects=effects, seed=5)
        for effects in ([parse_effect("deadband=0.7")], [])
    )
    last = close_gap(plain, max_effects=0).last
    assert last is not None
    again = replace(replay(plain, last, {}), session=held)
    session = sound_sessions.with_touch(held, first_of_repeats) if sent else plain
    (repeats,) = [one for one in compared_statistics(session, again) if one.name == "repeated positions"]
    assert repeats.agrees is agrees
    assert repeats.simulated > 0.1


def test_coarse_steps_whose_repeats_a_kernel_leaves_out_agree_with_positions_simulated_between_them() -> None:
    panel = replace(rig_for_screen("screen-1"), resolution_mm=0.3, touch_rate_hz=360.0)
    whole = simulate_session(panel, sound_sessions.brief_protocol(), seed=5)
    session = sound_sessions.with_touch(whole, first_of_repeats)
    last = close_gap(session, max_effects=0).last
    assert last is not None
    for measured in (whole, session):
        (share,) = [
            one for one in compared_statistics(measured, replay(session, last, {})) if one.name == "repeated positions"
        ]
        assert share.agrees
        assert share.measured > REPEATS_AS_OFTEN


def test_a_width_that_is_tolerated_disagrees_with_no_simulation() -> None:
    """0.12 mm of a width move edges by 0.06 mm: found as 0.049 mm, below the size of interest, it is known."""
    session = simulate_session("screen-1", load_protocol("demo"), effects=[parse_effect("beam_width=0.12")], seed=5)
    last = close_gap(session, max_effects=0).last
    assert last is not None
    again = replay(session, last, {})
    agrees = {}
    for tolerated in ((), (Tolerated("beam_width", 0.98, 0.049),), (Tolerated("scan_skew", 0.98, 0.049),)):
        (width,) = [one for one in compared_statistics(session, again, tolerated) if one.name == "stylus width"]
        agrees[tuple(item.follows for item in tolerated)] = width.agrees
    assert agrees == {(): False, ("beam_width",): True, ("scan_skew",): False}


@pytest.mark.parametrize("effect", ["sample_hold=70", "poll_grid=0.008", "timestamp_quantisation=0.006"])
def test_the_phase_of_a_host_s_ticks_is_that_of_the_measured_events(effect: str) -> None:
    """From a phase of its own a simulated run is late by up to a tick more, in which any disagreement could hide."""
    rig = replace(rig_for_screen("screen-1"), touch_rate_hz=400.0 if "quantisation" in effect else 120.0)
    session = simulate_session(rig, sound_sessions.brief_protocol(), effects=[parse_effect(effect)], seed=5)
    report = close_gap(session)
    assert [step.effect for step in report.steps] == [effect.split("=")[0]]
    assert report.verdict == "explained"
    assert all(one.agrees for one in report.check)
    (latency,) = [one for one in report.check if one.name == "latency by run"]
    assert latency.measured < 2 * latency.simulated
    assert latency.simulated < 0.5  # mm: at the 500 mm/s of the quick runs a millisecond, a sixth of the ticks
