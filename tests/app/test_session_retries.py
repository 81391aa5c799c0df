"""Runs that went wrong are recorded again at the end, unless the operator takes them off the list."""

from __future__ import annotations

from dataclasses import replace

from app.session_rigs import Recording, Wrapped, fast_rig, of_role, protocol, replaced
from draglag.analysis import AnalysisOptions, analyze
from draglag.recording import empty_laser
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


class BlindedAt(Wrapped):
    """A laser sensor that reports no edges before a time."""

    def __init__(self, inner, until_s):
        super().__init__(inner)
        self.until_s = until_s

    def read(self, timeout_s):
        batch = super().read(timeout_s)
        return replace(batch, laser=empty_laser()) if batch.until_s < self.until_s else batch


def test_a_whole_run_without_a_latency_comes_again_after_the_others(tmp_path):
    rig = fast_rig()
    rig = replaced(rig, BlindedAt(of_role(rig, "laser"), 5.0))
    recording = Recording(protocol(300, 500), rig, tmp_path / "s.h5", control=Control(retries=True))
    assert outcomes(recording) == [(name, "complete") for name in ("run-01", "run-02", "run-01-2")]
    assert [(e.run_id, e.outcome) for e in recording.of(events.RunQueued)] == [("run-01", "unusable")]


def test_a_run_repeated_until_it_is_given_up_has_every_id_once(tmp_path):
    ids = ("run-01", "run-01-2", "run-01-3")
    abort = aborting(*ids)

    def on_event(control, event):
        abort(control, event)
        if isinstance(event, events.RunQueued):
            control.repeat_run()

    recording = Recording(protocol(300, 500), fast_rig(), tmp_path / "s.h5", on_event, Control(retries=True))
    assert [run_id for run_id, _ in outcomes(recording)] == [*ids, "run-02"]


def test_a_run_that_goes_wrong_again_and_again_is_given_up(tmp_path):
    ids = ("run-01", "run-01-2", "run-01-3", "run-01-4")
    recording = Recording(protocol(300), fast_rig(), tmp_path / "s.h5", aborting(*ids), Control(retries=True))
    assert [run_id for run_id, _ in outcomes(recording)] == list(ids[:MOST_ATTEMPTS])


def test_a_practice_run_is_recorded_and_kept_out_of_the_curve(tmp_path):
    first = protocol(300).runs[0].model_copy(update={"practice": True})
    plan = protocol(200, 400, 500, 700, 900)
    plan = plan.model_copy(update={"runs": (first, *plan.runs)})
    recording = Recording(plan, fast_rig(), tmp_path / "s.h5")
    session = read_session(recording.path)
    assert [run.outcome for run in session.runs] == ["complete"] * 6
    found = analyze(session)
    assert found.excluded == {"run-01": "practice"}
    included = analyze(session, AnalysisOptions(include=frozenset({"run-01"})))
    assert included.excluded == {}
    assert included.curve.n_points == found.curve.n_points + 1
