"""What a session records is what happened in the simulated world, and every run has one outcome."""

import errno
import os
import threading
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from app.session_rigs import ROLES, DiesAt, DoesNotOpen, Recording, Wrapped, fast_rig, of_role, protocol, replaced
from draglag.errors import DataError
from draglag.latency import estimate_on_clock
from draglag.recording import ClockBounds, Run, Screen, Session, Stylus, TouchTrace, empty_laser, empty_touch
from draglag.store import SessionWriter, read_session, salvage
from draglag.store.frames import FrameFile
from draglag_app.session import Control, OffscreenDisplay, events
from draglag_app.session.conductor import PREVIEW_S
from draglag_app.session.machine import Phase
from draglag_app.session.readers import OpenFaults
from draglag_app.session.recorder import Recorder
from draglag_app.session.saver import Saver
from draglag_devices.source import Batch, DeviceError


def world_of(recording):
    return recording.rig.stage.players["sim"]


def assert_same_samples(run, truth, to_s=np.inf):
    """Every touch event and edge up to ``to_s``, none lost, none twice, values to the last bit."""
    touch, laser = truth.touch.t_s <= to_s, truth.laser.t_s <= to_s
    np.testing.assert_array_equal(run.touch.t_s, truth.touch.t_s[touch])
    np.testing.assert_array_equal(run.touch.x_mm, truth.touch.x_mm[touch])
    np.testing.assert_array_equal(run.touch.y_mm, truth.touch.y_mm[touch])
    np.testing.assert_array_equal(run.touch.contact_id, truth.touch.contact_id[touch])
    np.testing.assert_array_equal(run.touch.device_t_s, truth.touch.device_t_s[touch])
    np.testing.assert_array_equal(run.laser.device_t_s, truth.laser.device_t_s[laser])
    np.testing.assert_array_equal(run.laser.light, truth.laser.light[laser])


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    plan = protocol(300, 600, taps={"count": 12}, clock_check={"duration_s": 5.0})
    return Recording(plan, fast_rig(ROLES), tmp_path_factory.mktemp("whole") / "s.h5", note="hello")


def test_the_file_holds_what_happened(whole):
    session, world = read_session(whole.path), world_of(whole)
    assert [run.outcome for run in session.runs] == ["complete", "complete"]
    for run, truth in zip(session.runs, world.truth, strict=True):
        assert len(truth.touch.t_s) > 300
        assert len(truth.laser.t_s) > 5
        assert_same_samples(run, truth)
        # The bounds of one comparison of clocks are at most 0.4 ms wide.
        assert np.abs(run.laser.t_s - truth.laser.t_s).max() < 4e-4
        assert (run.touch.dropped, run.laser.missed) == (0, 0)


def test_the_file_says_what_was_planned_and_with_what(whole):
    session = read_session(whole.path)
    run = session.runs[0]
    assert (run.protocol, run.nominal_speed_mm_s, run.duration_s) == ("circle", 300.0, 4.0)
    assert run.target["speed_mm_s"] == 300.0
    assert session.devices["laser"].startswith("sim:")
    assert "hello" in [note.text for note in session.notes]
    assert session.protocol_toml == 'name = "test"'


def test_each_frame_the_participant_saw_is_kept(whole):
    run = read_session(whole.path).runs[1]
    np.testing.assert_allclose(run.display.t_s, run.start_s + np.arange(4 * 60 + 1) / 60, atol=1e-9)


def test_clocks_are_compared_in_runs_and_around_them(whole):
    session = read_session(whole.path)
    for owner in (session.clocks, session.runs[0].sync):
        laser = [bounds for bounds in owner if bounds.stream == "laser"]
        assert isinstance(laser[0], ClockBounds)
        assert len(laser[0].device_s) >= 4


def test_taps_are_paired_with_what_the_walt_felt(whole):
    taps, truth = read_session(whole.path).taps, world_of(whole).true_taps[0]
    np.testing.assert_array_equal(taps.registered_s, truth.registered_s)
    np.testing.assert_array_equal(taps.down, truth.down)
    assert np.abs(taps.physical_s - truth.physical_s).max() < 4e-4


def test_listeners_hear_each_run_in_order_and_of_all_samples(whole):
    finished = whole.of(events.RunFinished)
    assert [(event.run.id, event.outcome) for event in finished] == [("run-01", "complete"), ("run-02", "complete")]
    session = read_session(whole.path)
    for event, run in zip(finished, session.runs, strict=True):
        np.testing.assert_array_equal(event.run.touch.t_s, run.touch.t_s)
        np.testing.assert_array_equal(event.run.laser.t_s, run.laser.t_s)
        phases = [e.phase for e in whole.of(events.StateChanged) if e.run_id == run.id]
        assert phases == list(Phase)[1:]
        reported = [e for e in whole.of(events.SamplesArrived) if e.run_id == run.id and e.role == "touch"]
        assert sum(e.count for e in reported) == len(run.touch.t_s)
    assert whole.events[-1] == events.SessionFinished(whole.path, "")


class Lingers(Wrapped):
    """A screen that reports its last event long after the hand came to rest."""

    def __init__(self, inner, t_s):
        super().__init__(inner)
        self.t_s = t_s

    def read(self, timeout_s):
        batch = super().read(timeout_s)
        if batch.until_s < self.t_s:
            return batch
        last = replace(empty_touch(), **{
            field: np.full(1, value) for field, value in {
                "t_s": self.t_s, "x_mm": 250.0, "y_mm": 140.0, "contact_id": 1, "device_t_s": self.t_s,
            }.items()
        })  # fmt: skip
        self.t_s = np.inf
        return replace(batch, touch=last)


def test_a_preview_soon_after_the_end_and_the_whole_run_once_the_last_events_are_there(tmp_path):
    end_s, late_s = 0.5 + 20.0, 0.5 + 20.0 + 0.45
    rig = fast_rig()
    rig = replaced(rig, Lingers(of_role(rig, "touch"), late_s))
    recording = Recording(protocol(300, duration_s=20.0), rig, tmp_path / "s.h5")
    (early,), (late,) = recording.of(events.RunPreviewed), recording.of(events.RunFinished)
    assert recording.events.index(early) < recording.events.index(late)
    soon = late.run.touch.t_s <= end_s + PREVIEW_S
    np.testing.assert_array_equal(early.run.touch.t_s, late.run.touch.t_s[soon])
    assert late.run.touch.t_s[~soon].tolist() == [late_s]
    assert read_session(recording.path).runs[0].touch.t_s[-1] == late_s
    # The first estimate is the last one, within its interval.
    first, last = (estimate_on_clock(event.run, event.clocks, 7.0) for event in (early, late))
    assert abs(first.latency_s - last.latency_s) < 2 * last.latency_se_s


def test_a_source_that_is_late_costs_the_preview_and_no_events(tmp_path, monkeypatch):
    wait_past = Saver.wait_past

    def late(self, t_s, roles, timeout_s):
        lagging_roles = wait_past(self, t_s, roles, timeout_s)
        return ["touch"] if abs(t_s - (0.5 + 4.0 + PREVIEW_S)) < 1e-6 else lagging_roles

    monkeypatch.setattr(Saver, "wait_past", late)
    recording = Recording(protocol(300), fast_rig(), tmp_path / "s.h5")
    assert recording.of(events.RunPreviewed) == []
    (run,) = read_session(recording.path).runs
    assert run.outcome == "complete"
    assert_same_samples(run, world_of(recording).truth[0])


def test_samples_are_in_the_file_before_anyone_hears_of_them(tmp_path, monkeypatch):
    saved, early = [0], []
    flush, append = SessionWriter.flush, SessionWriter.append_touch
    waiting = [0]

    def counting_append(self, run_id, trace):
        append(self, run_id, trace)
        waiting[0] += len(trace.t_s)

    def counting_flush(self):
        flush(self)
        saved[0] = waiting[0]

    monkeypatch.setattr(SessionWriter, "append_touch", counting_append)
    monkeypatch.setattr(SessionWriter, "flush", counting_flush)
    heard = [0]

    def on_event(control, event):
        if isinstance(event, events.SamplesArrived) and event.role == "touch" and event.run_id:
            heard[0] += event.count
            early.append(heard[0] > saved[0])

    recording = Recording(protocol(300), fast_rig(), tmp_path / "s.h5", on_event)
    assert recording.error is None
    assert early
    assert not any(early)


def test_an_aborted_run_keeps_what_it_has_and_the_next_one_follows(tmp_path):
    def on_event(control, event):
        if isinstance(event, events.RunStarted) and event.run_id == "run-01":
            control.abort_run()

    recording = Recording(protocol(300, 600), fast_rig(), tmp_path / "s.h5", on_event)
    first, second = read_session(recording.path).runs
    assert (first.outcome, second.outcome) == ("aborted", "complete")
    assert first.duration_s < 4.0
    assert_same_samples(first, world_of(recording).truth[0], to_s=first.start_s + first.duration_s)
    assert_same_samples(second, world_of(recording).truth[1])


def test_an_abort_in_the_middle_keeps_the_first_half(tmp_path):
    control = Control()

    class AbortsAfterAWhile(OffscreenDisplay):
        def frames(self, until_s):
            if until_s > 5.0:
                control.abort_run()
            return super().frames(until_s)

    recording = Recording(
        protocol(300, duration_s=60.0),
        fast_rig(),
        tmp_path / "s.h5",
        control=control,
        display=AbortsAfterAWhile(),
    )
    (run,) = read_session(recording.path).runs
    assert run.outcome == "aborted"
    assert 3.0 < run.duration_s < 10.0
    assert run.touch.t_s[-1] > run.start_s + 3.0
    assert_same_samples(run, world_of(recording).truth[0], to_s=run.start_s + run.duration_s)


def test_a_stopped_session_is_whole_and_says_so(tmp_path):
    def on_event(control, event):
        if isinstance(event, events.RunFinished):
            control.stop()

    recording = Recording(protocol(300, 600, 900), fast_rig(), tmp_path / "s.h5", on_event)
    assert [run.id for run in read_session(recording.path).runs] == ["run-01"]
    assert "operator" in recording.events[-1].problem


def test_a_run_can_be_repeated_and_notes_are_kept(tmp_path):
    def on_event(control, event):
        if isinstance(event, events.RunStarted) and event.run_id == "run-01":
            control.note("the stylus slipped")
            control.repeat_run()

    recording = Recording(protocol(300, 600), fast_rig(), tmp_path / "s.h5", on_event)
    runs = read_session(recording.path).runs
    assert [run.id for run in runs] == ["run-01", "run-01-2", "run-02"]
    assert [entry.text for entry in runs[0].log if entry.level == "note"] == ["the stylus slipped"]


def test_the_operator_may_begin_each_run(tmp_path):
    control = Control(auto=False)
    began = []

    def on_event(control, event):
        if isinstance(event, events.RunFinished):
            began.append(event.run.id)
            control.proceed()

    Recording(protocol(300, 600), fast_rig(), tmp_path / "s.h5", on_event, control)
    assert began == ["run-01", "run-02"]


def test_asking_to_go_on_during_a_run_does_not_skip_the_rest_after_it(tmp_path):
    def on_event(control, event):
        if isinstance(event, events.RunStarted):
            control.proceed()

    def rest_s(on_event, name):
        first, second = read_session(Recording(protocol(300, 600), fast_rig(), tmp_path / name, on_event).path).runs
        return second.start_s - first.start_s - first.duration_s

    assert rest_s(on_event, "asked.h5") == pytest.approx(rest_s(None, "plain.h5"), abs=0.5)


# --- devices that fail ---


def test_a_device_lost_in_a_run_ends_it_and_leaves_the_file_whole(tmp_path):
    rig = fast_rig()
    lost = DiesAt(of_role(rig, "laser"), 3.0)
    recording = Recording(protocol(300, 600), replaced(rig, lost), tmp_path / "s.h5")
    assert recording.error is None
    (run,) = read_session(recording.path).runs
    truth = world_of(recording).truth[0]
    assert run.outcome == "device_lost"
    # The other source went on: all its events up to the end of the run are there.
    end_s = run.start_s + run.duration_s
    np.testing.assert_array_equal(run.touch.t_s, truth.touch.t_s[truth.touch.t_s <= end_s])
    assert run.laser.device_t_s.tolist() == truth.laser.device_t_s[: len(run.laser.t_s)].tolist()
    (fault,) = recording.of(events.DeviceFault)
    assert (fault.role, fault.remedy) == ("laser", "plug it in.")
    assert "cable" in recording.events[-1].problem
    assert any("cable" in entry.text for entry in run.log)


def test_any_exception_of_a_driver_is_a_lost_device(tmp_path):
    rig = fast_rig()
    broken = DiesAt(of_role(rig, "touch"), 3.0, ZeroDivisionError("inside the driver"))
    recording = Recording(protocol(300), replaced(rig, broken), tmp_path / "s.h5")
    assert [run.outcome for run in read_session(recording.path).runs] == ["device_lost"]
    assert "inside the driver" in recording.of(events.DeviceFault)[0].problem


def test_a_lost_walt_spoils_taps_and_no_run(tmp_path):
    rig = fast_rig(ROLES)
    recording = Recording(
        protocol(300, taps={"count": 5}), replaced(rig, DiesAt(of_role(rig, "walt"), 2.0)), tmp_path / "s.h5"
    )
    session = read_session(recording.path)
    assert [run.outcome for run in session.runs] == ["complete"]
    assert session.taps is None
    assert "cable" in recording.events[-1].problem


def test_all_faults_at_opening_are_reported_together_and_nothing_is_written(tmp_path):
    rig = fast_rig(ROLES)
    walt = Wrapped(of_role(rig, "walt"))
    for source in (DoesNotOpen(of_role(rig, "touch")), DoesNotOpen(of_role(rig, "laser")), walt):
        rig = replaced(rig, source)
    recording = Recording(protocol(300), rig, tmp_path / "s.h5")
    assert isinstance(recording.error, OpenFaults)
    assert [fault.remedy for fault in recording.error.faults] == ["connect the touch.", "connect the laser."]
    assert "no touch there" in str(recording.error)
    assert "no laser there" in str(recording.error)
    assert walt.closed == 1
    assert list(tmp_path.iterdir()) == []


def test_samples_that_found_no_room_are_counted_with_those_that_did():
    import queue
    import threading

    from draglag.recording import TouchTrace
    from draglag_app.session.readers import ReaderThread
    from draglag_devices.source import Batch

    inbox: queue.Queue = queue.Queue(1)
    stop = threading.Event()

    class Three:
        address, role, realtime = "test:", "touch", True
        count = 0

        def read(self, timeout_s):
            self.count += 1
            if self.count == 3:
                inbox.get()  # room again
            if self.count == 4:
                raise DeviceError(self.address, "end")
            t_s = np.array([float(self.count)])
            return Batch(float(self.count), touch=TouchTrace(t_s, t_s, t_s))

        def close(self):
            pass

    reader = ReaderThread(Three(), inbox, stop)
    reader.start()
    while (item := inbox.get(timeout=10)) and item.batch.until_s < 3.0:
        pass
    stop.set()
    reader.join(10)
    assert item.batch.touch.t_s.tolist() == [3.0]
    assert item.batch.touch.dropped == 1
    assert item.batch.touch.gaps_s.tolist() == [[1.0, 3.0]]


def test_a_disk_that_stalls_for_half_a_minute_costs_no_event_of_a_1_khz_touchscreen(tmp_path):
    events_of_30_s, disk_again = 30_000, threading.Event()

    class Touchscreen:
        """Reports one event at a time, far faster than it is saved."""

        address, role, realtime = "test:", "touch", True
        count = 0

        def read(self, timeout_s):
            if self.count == events_of_30_s:
                disk_again.set()
                threading.Event().wait(timeout_s)
                return Batch(31.0)
            self.count += 1
            t_s = np.array([self.count / 1000])
            return Batch(t_s[0], touch=TouchTrace(t_s, t_s, t_s))

        def close(self):
            pass

    header = Session("s", Screen("s", 300.0, 200.0, 1024, 768), Stylus(7.0), ())
    empty = Run("run-01", "free", 0.0, 31.0, empty_touch(), empty_laser())
    with SessionWriter(tmp_path / "s.h5", header) as writer:
        recorder = Recorder((Touchscreen(),), writer, lambda event: None)
        flush, writer.flush = writer.flush, lambda: disk_again.wait(60)
        recorder.start()
        recorder.saver.call(lambda: recorder.saver.begin_run(empty, 31.0))
        assert recorder.saver.wait_past(30.5, ("touch",), 60.0) == []
        writer.flush = flush
        run = recorder.saver.call(lambda: recorder.saver.end_run("complete", 31.0))
        recorder.stop()
    assert run.touch.dropped == 0
    assert len(run.touch.gaps_s) == 0


# --- files that fail ---


def test_a_full_disk_fails_the_run_and_keeps_what_was_saved(tmp_path, monkeypatch):
    append = SessionWriter.append_laser

    def full(self, run_id, trace):
        if run_id == "run-02":
            raise DataError("disk: cannot be written (No space left on device)", "Make room")
        append(self, run_id, trace)

    monkeypatch.setattr(SessionWriter, "append_laser", full)
    rig = fast_rig()
    recording = Recording(protocol(300, 600, 900), rig, tmp_path / "s.h5")
    assert isinstance(recording.error, DataError)
    assert "No space left" in str(recording.error)
    assert [event.outcome for event in recording.of(events.RunFinished)] == ["complete", "failed"]
    session = read_session(tmp_path / "s.h5.partial")
    assert_same_samples(session.runs[0], world_of(recording).truth[0])
    assert session.runs[1].outcome == "aborted"  # cut off, as far as the file knows


@contextmanager
def failing(monkeypatch, folder, number):
    """From its ``number``-th record on nothing can be written in the folder (EIO, ENOSPC …)."""
    append, count = FrameFile.append, [0]

    def filling(self, payload):
        count[0] += 1
        if self.path.parent == folder and count[0] >= number:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        append(self, payload)

    with monkeypatch.context() as patch:
        patch.setattr(FrameFile, "append", filling)
        yield


@pytest.mark.parametrize("number", [3, 4, 5, 6])
def test_a_full_disk_with_a_spare_place_costs_a_repeat_and_nothing_else(tmp_path, monkeypatch, number):
    (tmp_path / "spare").mkdir()
    with failing(monkeypatch, tmp_path, number):
        recording = Recording(
            protocol(300, 600), fast_rig(), tmp_path / "s.h5", control=Control(spare=tmp_path / "spare")
        )
    assert recording.error is None
    assert recording.path == tmp_path / "spare" / "s.h5"
    assert [path.name for path in tmp_path.glob("s.h5*")] == []
    session = read_session(recording.path)
    whole = [run for run in session.runs if run.outcome == "complete"]
    assert [run.nominal_speed_mm_s for run in whole] == [300, 600]
    assert [run.outcome for run in session.runs if run not in whole] in ([], ["failed"])
    truths = {truth.id: truth for truth in world_of(recording).truth}
    for run in whole:
        assert_same_samples(run, truths[run.id])


def test_no_room_for_the_session_file_at_the_end_makes_it_in_the_spare_place(tmp_path, monkeypatch):
    """The journal was whole, and its disk has no room for a second file of its size."""
    (tmp_path / "spare").mkdir()
    take_room, refused = os.posix_fallocate, []

    def full(fd, at, size):
        if not refused:
            refused.append(size)
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        take_room(fd, at, size)

    monkeypatch.setattr(os, "posix_fallocate", full)
    recording = Recording(protocol(300), fast_rig(), tmp_path / "s.h5", control=Control(spare=tmp_path / "spare"))
    assert recording.error is None
    assert refused
    (wanted,) = recording.of(events.PlaceWanted)
    assert "No space left on device" in wanted.problem
    assert "The recording is whole in" in wanted.remedy
    assert recording.path == tmp_path / "spare" / "s.h5"
    assert_same_samples(read_session(recording.path).runs[0], world_of(recording).truth[0])
    assert [path.name for path in tmp_path.iterdir()] == ["spare"]


def test_no_room_for_the_session_file_and_no_other_place_leaves_a_journal_that_can_be_saved(tmp_path, monkeypatch):
    def full(fd, at, size):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(os, "posix_fallocate", full)
        recording = Recording(protocol(300), fast_rig(), tmp_path / "s.h5")
    assert "draglag verify" in str(recording.error)
    assert [path.name for path in tmp_path.iterdir()] == ["s.h5.partial"]
    saved = salvage(tmp_path / "s.h5.partial", tmp_path / "elsewhere.h5")
    assert saved.losses == ()
    assert_same_samples(saved.session.runs[0], world_of(recording).truth[0])
    assert saved.session.runs[0].outcome == "complete"


def test_a_journal_deleted_while_recording_costs_nothing_and_is_reported(tmp_path):
    def on_event(control, event):
        if isinstance(event, events.RunFinished) and event.run.id == "run-01":
            (tmp_path / "s.h5.partial").unlink()

    recording = Recording(protocol(300, 600), fast_rig(), tmp_path / "s.h5", on_event)
    assert recording.error is None
    assert any("was deleted while it was recorded" in event.text for event in recording.of(events.NoticeRaised))
    for run, truth in zip(read_session(recording.path).runs, world_of(recording).truth, strict=True):
        assert_same_samples(run, truth)


def test_a_listener_that_raises_is_reported_as_such_and_costs_no_sample(tmp_path):
    def on_event(control, event):
        if isinstance(event, events.SamplesArrived):
            raise ValueError("a bug of the display")

    recording = Recording(protocol(300, 600), fast_rig(), tmp_path / "s.h5", on_event)
    assert recording.error is None
    reported = [event.text for event in recording.of(events.NoticeRaised)]
    assert reported == ["a listener to the recording failed (ValueError: a bug of the display); the recording goes on"]
    session = read_session(recording.path)
    for run, truth in zip(session.runs, world_of(recording).truth, strict=True):
        assert run.outcome == "complete"
        assert_same_samples(run, truth)
    logged = [
        entry for entry in (*session.notes, *(e for run in session.runs for e in run.log)) if entry.source == "listener"
    ]
    assert [(entry.level, entry.text) for entry in logged] == [("error", reported[0])]


def test_an_existing_file_is_refused_before_any_device_is_opened(tmp_path):
    out = tmp_path / "s.h5"
    out.write_bytes(b"precious")
    rig = fast_rig()
    touch = DoesNotOpen(of_role(rig, "touch"))
    recording = Recording(protocol(300), replaced(rig, touch), out)
    assert isinstance(recording.error, DataError)
    assert out.read_bytes() == b"precious"


def test_a_protocol_without_its_source_is_refused(tmp_path):
    recording = Recording(protocol(300), fast_rig(("touch",)), tmp_path / "s.h5")
    assert isinstance(recording.error, DeviceError)
    assert "--laser" in recording.error.remedy


def test_taps_need_no_laser(tmp_path):
    plan = protocol(taps={"count": 5})
    recording = Recording(plan, fast_rig(("touch", "walt")), tmp_path / "s.h5")
    assert len(read_session(recording.path).taps.physical_s) == 10


class Prompts(OffscreenDisplay):
    """Remembers what the participant is asked."""

    def __init__(self):
        super().__init__()
        self.said = []

    def prompt(self, text):
        self.said.append(text)


@pytest.mark.parametrize(("speeds", "checks"), [((), 1), ((300,), 2)])
def test_clocks_are_checked_before_and_after_runs_and_once_where_there_are_none(tmp_path, speeds, checks):
    shown = Prompts()
    Recording(protocol(*speeds, clock_check={"duration_s": 5.0}), fast_rig(), tmp_path / "s.h5", display=shown)
    assert sum("Comparing clocks" in text for text in shown.said) == checks
