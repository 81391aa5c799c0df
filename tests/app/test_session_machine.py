"""A run has exactly one outcome, whatever happens in whatever order."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from draglag.recording import OUTCOMES
from draglag_app.session.machine import Phase, RunState, Signal, advance

ORDER = list(Phase)
ENDINGS = {Signal.ABORT: "aborted", Signal.DEVICE_LOST: "device_lost", Signal.FAILURE: "failed"}


def run_through(signals):
    states = [RunState()]
    for signal in signals:
        states.append(advance(states[-1], signal))
    return states


GOOD = [Signal.PREPARE, Signal.READY, Signal.TARGET_MOVES, Signal.TARGET_DONE, Signal.DRAINED]


def test_a_run_without_trouble_is_complete():
    phases = [state.phase for state in run_through(GOOD)]
    assert phases == ORDER
    assert run_through(GOOD)[-1].outcome == "complete"


@pytest.mark.parametrize(("signal", "outcome"), ENDINGS.items())
@pytest.mark.parametrize("after", range(1, 5))
def test_trouble_at_any_moment_names_the_outcome(signal, outcome, after):
    states = run_through([*GOOD[:after], signal, Signal.DRAINED])
    assert states[-1].outcome == outcome


@given(st.lists(st.sampled_from(Signal), max_size=30))
def test_any_order_of_signals_leads_to_at_most_one_outcome(signals):
    states = run_through(signals)
    places = [ORDER.index(state.phase) for state in states]
    assert places == sorted(places)  # never back
    outcomes = {state.outcome for state in states} - {None}
    assert len(outcomes) <= 1
    for state in states:
        assert (state.outcome in OUTCOMES) == (state.phase is Phase.FINISHED)


@given(st.lists(st.sampled_from(Signal), max_size=30))
def test_every_run_can_be_ended(signals):
    state = run_through([*signals, Signal.ABORT, Signal.DRAINED])[-1]
    assert state.phase is Phase.FINISHED
    assert state.outcome in OUTCOMES


@given(st.permutations([Signal.ABORT, Signal.DEVICE_LOST, Signal.FAILURE]))
def test_the_worst_of_several_troubles_is_reported(troubles):
    assert run_through([*GOOD[:3], *troubles, Signal.DRAINED])[-1].outcome == "failed"


@given(st.lists(st.sampled_from(Signal), max_size=10))
def test_a_finished_run_never_changes(signals):
    assert run_through([*GOOD, *signals])[-1] == run_through(GOOD)[-1]
