"""What the session asks of sources and hears from the operator between runs."""

import threading
from dataclasses import replace

import numpy as np
import pytest

from app.session_rigs import NeedsPanel, Recording, Wrapped, fast_rig, of_role, protocol, replaced
from draglag.protocol.presets import load_screen
from draglag.recording import ClockBounds, Taps
from draglag.store import read_session
from draglag_app.preflight import preflight
from draglag_app.session import Control, events
from draglag_app.session.display import OffscreenDisplay
from draglag_app.session.machine import Phase
from draglag_devices.source import Notice

SCREEN = load_screen("screen-1")


def test_a_touchscreen_without_a_resolution_is_reported_the_size_of_the_panel(tmp_path):
    rig = fast_rig()
    source = NeedsPanel(of_role(rig, "touch"))
    recording = Recording(protocol(300), replaced(rig, source), tmp_path / "s.h5")
    assert recording.error is None
    assert source.panel_mm == (SCREEN.width_mm, SCREEN.height_mm)


def test_the_preflight_reports_it_too(monkeypatch, tmp_path):
    rig = fast_rig()
    source = NeedsPanel(of_role(rig, "touch"))
    monkeypatch.setattr("draglag_app.preflight.make_rig", lambda *a, **k: replaced(rig, source))
    screen = Recording(protocol(300), fast_rig(), tmp_path / "s.h5")
    panel = read_session(screen.path).screen
    checks = list(preflight({"touch": "evdev:x", "laser": "sim:"}, panel, watch_s=1.0, folder=tmp_path))
    assert source.panel_mm == (panel.width_mm, panel.height_mm)
    assert not [check for check in checks if check.name == "touch" and check.state == "fault"]


# --- comparisons of clocks ---


class Compares(Wrapped):
    """A laser or WALT that compares its clock with the host's when it is asked, and only then."""

    def __init__(self, inner):
        super().__init__(inner)
        self.asked_s = []
        self.answered = 0
        self._waiting = []
        self._t_s = 0.0

    def synchronise(self):
        done = threading.Event()
        self.asked_s.append(self._t_s)
        self._waiting.append(done)
        return done

    def read(self, timeout_s):
        batch = super().read(timeout_s)
        self._t_s = batch.until_s
        waiting, self._waiting = self._waiting, []
        at_s = np.full(len(waiting), batch.until_s)
        clock = ClockBounds(self.role, at_s + 500.0, at_s - 1e-4, at_s + 1e-4, np.zeros(len(waiting), np.int64))
        for done in waiting:
            self.answered += 1
            done.set()
        return replace(batch, clock=clock if len(at_s) else None)


def test_clocks_are_compared_in_full_before_and_after_each_run_and_kept_with_it(tmp_path):
    rig = fast_rig()
    source = Compares(of_role(rig, "laser"))
    recording = Recording(protocol(300, 600), replaced(rig, source), tmp_path / "s.h5")
    assert recording.error is None
    runs = read_session(recording.path).runs
    assert len(source.asked_s) == 2 * len(runs) == 4
    for run in runs:
        (bounds,) = run.sync
        assert len(bounds.device_s) == 2
        assert bounds.host_min_s[0] <= run.start_s + 0.25
        assert bounds.host_max_s[1] >= run.start_s + run.duration_s


class ShowsTaps(OffscreenDisplay):
    """Remembers how many comparisons were asked for, and made, when the participant was asked to tap."""

    def __init__(self, source):
        super().__init__()
        self.source = source
        self.compared = []

    def show(self, target, start_s):
        super().show(target, start_s)
        self.compared.append((len(self.source.asked_s), self.source.answered))


def test_a_walt_has_compared_before_anybody_is_asked_to_tap(tmp_path):
    rig = fast_rig(("touch", "walt"))
    source = Compares(of_role(rig, "walt"))
    display = ShowsTaps(source)
    taps = protocol(taps={"count": 3})
    recording = Recording(taps, replaced(rig, source), tmp_path / "s.h5", display=display)
    assert recording.error is None
    assert len(source.asked_s) == 2
    assert display.compared == [(1, 1)]


class NeverCompares(Compares):
    def synchronise(self):
        self.asked_s.append(self._t_s)
        return threading.Event()


def test_a_source_that_does_not_answer_does_not_hold_the_session(tmp_path, monkeypatch):
    monkeypatch.setattr("draglag_app.session.comparing._COMPARE_S", 0.1)
    rig = fast_rig()
    source = NeverCompares(of_role(rig, "laser"))
    recording = Recording(protocol(300), replaced(rig, source), tmp_path / "s.h5")
    assert recording.error is None
    assert [run.outcome for run in read_session(recording.path).runs] == ["complete"]


# --- the operator between runs ---


class RestWatch(OffscreenDisplay):
    """Calls ``at_rest(number)`` when the participant is asked to rest."""

    def __init__(self, at_rest):
        super().__init__()
        self.at_rest = at_rest
        self.rests = 0

    def prompt(self, text):
        if text == "Rest":
            self.rests += 1
            self.at_rest(self.rests)


@pytest.mark.parametrize("auto", [True, False])
def test_repeat_in_the_rest_repeats_the_run_just_ended(tmp_path, auto):
    control = Control(auto)

    def at_rest(number):
        if number == 1:
            control.repeat_run()
        elif not auto:
            control.proceed()

    watch = RestWatch(at_rest)
    recording = Recording(protocol(300, 600), fast_rig(), tmp_path / "s.h5", control=control, display=watch)
    assert [run.id for run in read_session(recording.path).runs] == ["run-01", "run-01-2", "run-02"]


def test_asking_twice_is_once_and_a_second_rest_may_ask_again(tmp_path):
    control = Control()

    def at_rest(number):
        if number in (1, 2):
            control.repeat_run()
            control.repeat_run()

    def on_event(control, event):
        if isinstance(event, events.RunStarted) and event.run_id == "run-01":
            control.repeat_run()

    recording = Recording(
        protocol(300, 600), fast_rig(), tmp_path / "s.h5", on_event, control, display=RestWatch(at_rest)
    )
    ids = [run.id for run in read_session(recording.path).runs]
    assert ids == ["run-01", "run-01-2", "run-01-3", "run-02"]


def test_a_repeat_asked_for_in_the_last_run_repeats_it(tmp_path):
    def on_event(control, event):
        if isinstance(event, events.RunStarted) and event.run_id == "run-02":
            control.repeat_run()

    recording = Recording(protocol(300, 600), fast_rig(), tmp_path / "s.h5", on_event)
    assert [run.id for run in read_session(recording.path).runs] == ["run-01", "run-02", "run-02-2"]


def test_nothing_is_repeated_before_there_was_a_run(tmp_path):
    control = Control()
    control.repeat_run()
    plan = protocol(300, clock_check={"duration_s": 2.0})
    recording = Recording(plan, fast_rig(), tmp_path / "s.h5", control=control)
    assert [run.id for run in read_session(recording.path).runs] == ["run-01"]


def test_an_abort_between_runs_aborts_nothing_and_the_rest_lasts(tmp_path):
    control = Control()
    recording = Recording(
        protocol(300, 600), fast_rig(), tmp_path / "s.h5", control=control,
        display=RestWatch(lambda number: control.abort_run()),
    )  # fmt: skip
    runs = read_session(recording.path).runs
    assert [run.outcome for run in runs] == ["complete", "complete"]
    ended_s = runs[0].start_s + runs[0].duration_s
    assert runs[1].start_s - ended_s >= 1.0 + 0.5  # the rest and the countdown
    assert recording.of(events.StateChanged)[-1].phase is Phase.FINISHED


# --- what a source rejects ---


class Rejects(Wrapped):
    """A WALT that hears each shock ring on."""

    def read(self, timeout_s):
        batch = super().read(timeout_s)
        if batch.taps is None or not len(batch.taps.physical_s):
            return batch
        return replace(batch, taps=replace(batch.taps, rejected={"ringing": len(batch.taps.physical_s)}))


def test_taps_that_a_source_rejects_are_added_up_and_saved(tmp_path):
    rig = fast_rig(("touch", "laser", "walt"))
    plan = protocol(taps={"count": 12})
    recording = Recording(plan, replaced(rig, Rejects(of_role(rig, "walt"))), tmp_path / "s.h5")
    taps: Taps = read_session(recording.path).taps
    assert taps.rejected["ringing"] == 24
    assert len(taps.physical_s) == 24
    assert recording.of(events.TapsArrived)[-1].rejected >= 24


class Untouched(Wrapped):
    """A touchscreen that nobody touches, or whose events are no touch."""

    def read(self, timeout_s):
        return replace(super().read(timeout_s), touch=None, contacts=None)


def test_a_session_without_any_touch_says_so_in_the_run_and_is_not_saved_as_whole(tmp_path):
    rig = fast_rig()
    rec = Recording(protocol(600, duration_s=6.0), replaced(rig, Untouched(of_role(rig, "touch"))), tmp_path / "s.h5")
    (finished,) = rec.of(events.SessionFinished)
    assert finished.problem.startswith("No touch was recorded in any run.")
    assert len(read_session(rec.path).runs) == 1
    (notices,) = [event for event in rec.of(events.NoticeRaised) if event.source == "touch"]
    assert (notices.level, notices.text.split(":")[0]) == ("warning", "No touch has come in the first 4 s of run-01")


def test_what_a_source_has_not_said_yet_is_in_the_file(tmp_path):
    class Counts(Wrapped):
        def final_notices(self):
            return (Notice(1.0, "info", "3 cycles were disturbed."),)

    rig = fast_rig()
    rec = Recording(protocol(600), replaced(rig, Counts(of_role(rig, "laser"))), tmp_path / "s.h5")
    assert [note.text for note in read_session(rec.path).notes if note.source == "laser"] == [
        "3 cycles were disturbed."
    ]
