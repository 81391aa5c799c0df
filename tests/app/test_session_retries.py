"""Runs that went wrong are recorded again at the end, unless the operator takes them off the list."""

from __future__ import annotations

from app.session_rigs import Recording, fast_rig, protocol
from draglag.store import read_session
from draglag_app.session import Control, events
from draglag_app.session.conductor import MOST_ATTEMPTS
from draglag_app.session.machine import Phase


def aborting(*ids):
    """Abort these runs while they are recorded."""

    def on_event(control, event):
        if isinstance(event, events.StateChanged) and event.phase is Phase.RECORDING and event.run_id in ids:
            control.abort_run()

    return on_event


def outcomes(recording):
    return [(run.id, run.outcome) for run in read_session(recording.path).runs]


def test_an_aborted_run_comes_again_after_the_others(tmp_path):
    recording = Recording(protocol(300, 500), fast_rig(), tmp_path / "s.h5", aborting("run-01"), Control(retries=True))
    assert outcomes(recording) == [("run-01", "aborted"), ("run-02", "complete"), ("run-01-2", "complete")]
    assert [e.run_id for e in recording.events if isinstance(e, events.RunQueued)] == ["run-01"]


def test_nothing_comes_again_without_being_asked_for(tmp_path):
    recording = Recording(protocol(300, 500), fast_rig(), tmp_path / "s.h5", aborting("run-01"))
    assert [run_id for run_id, _ in outcomes(recording)] == ["run-01", "run-02"]


def test_a_run_taken_off_the_list_does_not_come_again(tmp_path):
    abort = aborting("run-02")

    def on_event(control, event):
        abort(control, event)
        if isinstance(event, events.RunQueued):
            assert control.unqueue(event.run_id)

    recording = Recording(protocol(300, 500), fast_rig(), tmp_path / "s.h5", on_event, Control(retries=True))
    assert [run_id for run_id, _ in outcomes(recording)] == ["run-01", "run-02"]


def test_a_run_repeated_at_once_does_not_come_again(tmp_path):
    abort = aborting("run-01")

    def on_event(control, event):
        abort(control, event)
        if isinstance(event, events.RunQueued):
            control.repeat_run()

    recording = Recording(protocol(300, 500), fast_rig(), tmp_path / "s.h5", on_event, Control(retries=True))
    assert [run_id for run_id, _ in outcomes(recording)] == ["run-01", "run-01-2", "run-02"]


def test_a_run_that_goes_wrong_again_and_again_is_given_up(tmp_path):
    ids = ("run-01", "run-01-2", "run-01-3", "run-01-4")
    recording = Recording(protocol(300), fast_rig(), tmp_path / "s.h5", aborting(*ids), Control(retries=True))
    assert [run_id for run_id, _ in outcomes(recording)] == list(ids[:MOST_ATTEMPTS])
