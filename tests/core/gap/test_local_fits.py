"""Local fits about all edges of a session: on all traces as one, each made once."""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np

from draglag.exchange import read_exchange
from draglag.gap.fitting.joint import fit_session
from draglag.gap.traces.edges import place
from draglag.gap.traces.local_fits import POSITION_STEP_S, Kept, traces_of
from draglag.gap.traces.run_data import gather
from draglag.path.local_fit import local_fit
from draglag.recording import FloatArray, IntArray

SAMPLES = Path(__file__).parents[2] / "data" / "exchange"


def test_fits_on_all_traces_as_one_are_those_on_each_run_alone() -> None:
    runs = gather(read_exchange(SAMPLES / "none-A"))
    traces = traces_of(runs)
    at_s = traces.edge_t_s + 0.06
    rows = traces.positions.at(at_s, traces.half_s, traces.edges)
    assert np.max(np.abs(rows[:, 0] - at_s)) <= 0.5 * POSITION_STEP_S
    weights = traces.rows(rows[:, 0], traces.half_s, lambda by_event: by_event.position)
    for k, data in enumerate(runs):
        own = traces.run == k
        alone = local_fit(data.t_s, data.xy_mm, rows[own, 0] - traces.shift_s[k], data.half_s)
        assert np.array_equal(rows[own, 7] > 0, alone.ok)
        np.testing.assert_allclose(rows[own, 1:3][alone.ok], alone.xy_mm[alone.ok], atol=1e-6)
        np.testing.assert_allclose((weights @ traces.xy_mm)[own][alone.ok], alone.xy_mm[alone.ok], atol=1e-6)


def test_a_row_about_an_edge_is_made_once_for_each_time_and_width() -> None:
    asked: list[int] = []

    def make(at_s: FloatArray, half_s: FloatArray, edges: IntArray) -> FloatArray:
        asked.append(at_s.size)
        return np.column_stack([at_s, half_s, edges])

    kept, edges = Kept(make, np.array([0.0, 5.0, 9.0]), 0.01), np.arange(3)
    at_s, half_s = np.array([0.021, 5.043, 9.0]), np.array([0.1, 0.1, 0.2])
    first = kept.at(at_s, half_s, edges)
    np.testing.assert_allclose(first, np.column_stack([[0.02, 5.04, 9.0], half_s, edges]))
    np.testing.assert_array_equal(kept.at(at_s + 0.002, half_s, edges), first)  # within half a step
    moved = kept.at(at_s + np.array([0.0, 0.02, 0.0]), np.array([0.1, 0.1, 0.3]), edges)
    np.testing.assert_allclose(moved, np.column_stack([[0.02, 5.06, 9.0], [0.1, 0.1, 0.3], edges]))
    np.testing.assert_array_equal(kept.at(at_s[1:], half_s[1:], edges[1:]), first[1:])
    assert asked == [3, 2]
    kept.at(np.full(3, np.nan), half_s, edges)  # nowhere, and no other time's row
    np.testing.assert_allclose(kept.at(np.array([0.0, 5.0, 9.0]), half_s, edges)[:, 0], [0.0, 5.0, 9.0])


def test_traces_go_to_another_process_after_fits_were_made_on_them() -> None:
    traces = traces_of(gather(read_exchange(SAMPLES / "none-A")))
    at_s = traces.edge_t_s + 0.06
    here = traces.positions.at(at_s, traces.half_s, traces.edges)
    sent = pickle.loads(pickle.dumps(traces))
    np.testing.assert_array_equal(sent.positions.at(at_s, sent.half_s, sent.edges), here)


def test_an_edge_is_placed_alike_wherever_its_search_began() -> None:
    """The cost of a fit would depend on its past: a quarter of a mm/s of each speed is some nats of a quiet session."""
    session = read_exchange(SAMPLES / "none-A")
    runs = gather(session)
    law = fit_session(session, runs).law
    settled = place(runs, law, start=place(runs, law))
    for off_s in (-8e-4, 8e-4):
        apart = place(runs, replace(law, a7_s=law.a7_s + off_s), start=settled)
        again = place(runs, law, start=apart)
        ok = settled.ok & again.ok
        assert np.sqrt(np.mean((again.v_mm_s - settled.v_mm_s)[ok] ** 2)) < 0.02
        assert np.sqrt(np.mean((again.xy_mm - settled.xy_mm)[ok] ** 2)) < 2e-3


def test_changes_of_speed_follow_a_later_law_in_proportion() -> None:
    """Steps from one grid time to the next would be steps of the cost."""
    session = read_exchange(SAMPLES / "none-A")
    runs = gather(session)
    law = fit_session(session, runs).law
    settled = place(runs, law, start=place(runs, law))
    later = [place(runs, replace(law, a7_s=law.a7_s + by_s), start=settled) for by_s in (1e-4, 5e-4)]
    ok = np.logical_and.reduce([settled.ok & settled.steady, *(one.ok for one in later)])
    by_one, by_five = ((one.accel_apart_mm_s2 - settled.accel_apart_mm_s2)[ok] for one in later)
    assert np.sqrt(np.mean((by_five - 5 * by_one) ** 2)) < 0.2 * np.sqrt(np.mean(by_five**2))
