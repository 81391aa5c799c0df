"""Local fits about all edges of a session: on all traces as one, each made once."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np

from draglag.exchange import read_exchange
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
