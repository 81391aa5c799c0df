"""Devices that fail at the worst moments: the session goes on, and each run reports what it lacks.

Simulated instruments, so that every fault meets every moment; ``tests/devices`` tests the drivers.
"""

from __future__ import annotations

import threading
from abc import abstractmethod
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.session_rigs import Recording, Wrapped, fast_rig, protocol
from draglag.analysis import Analysis, analyze
from draglag.recording import LaserTrace, Session, TouchTrace, concatenate, empty_laser, empty_touch
from draglag.store import read_session, verify
from draglag_app.session import Control, events, watch
from draglag_app.session.machine import Phase
from draglag_app.session.orderly import Order
from draglag_devices.rig import Rig, make_rig
from draglag_devices.sim.clocks import DeviceClock
from draglag_devices.source import Batch, DeviceError, Notice
from emulators import ethercat

# Recording counts down for 0.5 s, a run lasts 4 s and its tail 0.5 s, the rest 1 s.
MOMENTS = {
    "arming": (0.2, 0.45),
    "first sample": (0.4, 0.8),
    "middle": (2.0, 2.5),
    "last sample": (4.2, 4.9),
    "between runs": (5.2, 5.8),
}
_RUN_S = (0.5, 5.0)


class Troubled(Wrapped):
    """A source that is in trouble from one time to another, in the time that it reports."""

    def __init__(self, inner: Any, from_s: float, to_s: float) -> None:
        super().__init__(inner)
        self.from_s, self.to_s = from_s, to_s
        self.begun = self.ended = False

    def read(self, timeout_s: float) -> Batch:
        batch = super().read(timeout_s)
        if batch.until_s < self.from_s or self.ended:
            return batch
        if batch.until_s > self.to_s and self.begun:
            self.ended = True
            return self.after(batch)
        first, self.begun = not self.begun, True
        return self.during(batch, first)

    @abstractmethod
    def during(self, batch: Batch, first: bool) -> Batch: ...

    def after(self, batch: Batch) -> Batch:
        return batch

    def lack(self, batch: Batch) -> Batch:
        """The batch with a gap over the whole trouble, as a driver marks it."""
        gap = np.array([[self.from_s, self.to_s]])
        if self.role == "laser":
            loss: Any = replace(empty_laser(), gaps_s=gap, missed=1)
            return replace(batch, laser=loss if batch.laser is None else concatenate([loss, batch.laser]))
        loss = replace(empty_touch(), gaps_s=gap, dropped=1)
        return replace(batch, touch=loss if batch.touch is None else concatenate([loss, batch.touch]))


class Unplugged(Troubled):
    """Away, then back."""

    def during(self, batch: Batch, first: bool) -> Batch:
        notices = (Notice(batch.until_s, "error", "it was unplugged", "lost"),) if first else ()
        return Batch(batch.until_s, notices=notices, alive=False)

    def after(self, batch: Batch) -> Batch:
        return self.lack(replace(batch, notices=(Notice(batch.until_s, "info", "it is back", "back"),)))


class Frozen(Troubled):
    """It says nothing at all, then everything. (Simulated time waits for it: tried in real time.)"""

    def __init__(self, inner: Any, from_s: float, to_s: float) -> None:
        super().__init__(inner, from_s, to_s)
        self.held: list[Batch] = []

    def during(self, batch: Batch, first: bool) -> Batch:
        self.held.append(batch)
        return Batch(self.from_s)

    def after(self, batch: Batch) -> Batch:
        whole = [*self.held, batch]
        kinds: dict[str, Any] = {}
        for kind in ("touch", "laser", "clock"):
            parts = [getattr(one, kind) for one in whole if getattr(one, kind) is not None]
            kinds[kind] = concatenate(parts) if parts else None
        return replace(batch, **kinds)


class Babbling(Troubled):
    """A thousand times as many samples as there are."""

    def during(self, batch: Batch, first: bool) -> Batch:
        t_s = np.linspace(max(batch.until_s - 0.2, self.from_s), batch.until_s, 5000)
        if self.role == "laser":
            edges = LaserTrace(t_s, np.arange(5000) % 2, device_t_s=t_s, epoch=np.zeros(5000, np.int64))
            return replace(batch, laser=edges)
        noise = np.random.default_rng(3).uniform(0, 300, (2, 5000))
        ids = np.full(5000, 1)
        return replace(batch, touch=TouchTrace(t_s, *noise, ids, *noise, device_t_s=t_s))


class Resetting(Troubled):
    """It restarts: its clock starts at zero."""

    def during(self, batch: Batch, first: bool) -> Batch:
        return Batch(batch.until_s, alive=False)

    def after(self, batch: Batch) -> Batch:
        notice = Notice(batch.until_s, "warning", "it restarted", "back")
        return self.lack(self._renewed(replace(batch, notices=(notice,))))

    def read(self, timeout_s: float) -> Batch:
        was_ended = self.ended
        batch = super().read(timeout_s)
        return self._renewed(batch) if was_ended else batch

    def _renewed(self, batch: Batch) -> Batch:
        """The stamps of a clock that was set to zero, in an epoch of their own."""
        laser, clock = batch.laser, batch.clock
        if laser is not None and len(laser.t_s):
            laser = replace(laser, device_t_s=laser.device_t_s - 1e4, epoch=laser.epoch + 1)
        if clock is not None:
            clock = replace(clock, device_s=clock.device_s - 1e4, epoch=clock.epoch + 1)
        return replace(batch, laser=laser, clock=clock)


class Drifting(Troubled):
    """Its clock runs 200 ppm faster from that time on, for good."""

    def __init__(self, inner: Any, from_s: float, to_s: float) -> None:
        super().__init__(inner, from_s, np.inf)
        self.device_from_s = np.nan

    def during(self, batch: Batch, first: bool) -> Batch:
        clock, laser = batch.clock, batch.laser
        if clock is not None and len(clock.device_s) and np.isnan(self.device_from_s):
            self.device_from_s = float(clock.device_s[0])
        if clock is not None:
            clock = replace(clock, device_s=self._faster(clock.device_s))
        if laser is not None:
            laser = replace(laser, device_t_s=self._faster(laser.device_t_s))
        return replace(batch, clock=clock, laser=laser)

    def _faster(self, device_s: np.ndarray) -> np.ndarray:
        if np.isnan(self.device_from_s):
            return device_s
        return device_s + 200e-6 * np.maximum(0.0, device_s - self.device_from_s)


FAULTS = {"unplugged": Unplugged, "babbling": Babbling, "resetting": Resetting, "drifting": Drifting}


def record(tmp_path: Path, troubled: dict[str, tuple[str, str]]) -> tuple[Recording, Session]:
    """Two runs; role → (fault, moment)."""
    rig = fast_rig()
    sources = []
    for source in rig.sources:
        fault, moment = troubled.get(source.role, ("", ""))
        sources.append(FAULTS[fault](source, *MOMENTS[moment]) if fault else source)
    recording = Recording(protocol(300, 600), Rig(tuple(sources), rig.stage), tmp_path / "s.h5")
    assert recording.error is None, recording.error
    return recording, read_session(recording.path)


def sound(session: Session) -> None:
    """All runs are there, the second as it happened, and the file contradicts itself nowhere."""
    assert [run.outcome for run in session.runs] == ["complete", "complete"]
    estimate = next(run for run in analyze(session).runs if run.id == "run-02")
    assert estimate.latency_s is not None
    assert "device_gap" not in estimate.flags


@pytest.mark.parametrize("moment", MOMENTS)
@pytest.mark.parametrize(("role", "fault"), [
    ("touch", "unplugged"),
    ("touch", "babbling"),
    ("touch", "resetting"),
    ("laser", "unplugged"),
    ("laser", "babbling"),
    ("laser", "resetting"),
])  # fmt: skip
def test_the_session_goes_on_and_the_run_says_what_it_lacks(role: str, fault: str, moment: str, tmp_path: Path) -> None:
    recording, session = record(tmp_path, {role: (fault, moment)})
    sound(session)
    assert not [finding for finding in verify(recording.path) if finding.level == "error"]
    first = session.runs[0]
    trace: Any = getattr(first, role)
    from_s, to_s = MOMENTS[moment]
    touched = from_s < _RUN_S[1] and to_s > _RUN_S[0]  # the trouble reaches into the run
    if fault in ("unplugged", "resetting") and touched:
        assert len(trace.gaps_s)
        assert (trace.dropped if role == "touch" else trace.missed) >= 1
        said = [entry.text for entry in first.log if entry.source == role]
        assert any("unplugged" in text or "back" in text or "restarted" in text for text in said), said
    if fault == "babbling" and moment == "middle":
        assert len(trace.t_s) > 5000  # all of it was kept
        known = next(run for run in analyze(session).runs if run.id == "run-01")
        assert known.flags or abs(known.latency_s - _true_latency_s()) < 5e-3


def _true_latency_s() -> float:
    world = fast_rig().stage.players["sim"]
    return float(world.rig.law.latency_s(np.array([300.0]))[0])


@pytest.mark.parametrize("moment", MOMENTS)
def test_two_devices_at_once_are_both_said(moment: str, tmp_path: Path) -> None:
    _, session = record(tmp_path, {"touch": ("unplugged", moment), "laser": ("resetting", moment)})
    sound(session)
    run_plan = [entry for run in session.runs for entry in run.log] + list(session.notes)
    assert {"touch", "laser"} <= {entry.source for entry in run_plan}


@pytest.mark.parametrize("moment", MOMENTS)
@pytest.mark.parametrize("roles", [("touch",), ("laser",), ("touch", "laser")])
def test_what_is_gone_for_good_ends_the_session_with_a_whole_file(
    roles: tuple[str, ...], moment: str, tmp_path: Path
) -> None:
    class Gone(Troubled):
        def during(self, batch: Batch, first: bool) -> Batch:
            raise DeviceError(self.address, f"the {self.role} was pulled out", "plug it in")

    rig = fast_rig()
    sources = tuple(Gone(s, *MOMENTS[moment]) if s.role in roles else s for s in rig.sources)
    recording = Recording(protocol(300, 600), Rig(sources, rig.stage), tmp_path / "s.h5")
    assert recording.error is None
    session = read_session(recording.path)
    problem = recording.events[-1].problem
    assert any(f"{role} was pulled out" in problem for role in roles)
    outcomes = [run.outcome for run in session.runs]
    expected = ["complete"] if moment == "between runs" else ["device_lost"]
    assert outcomes == expected
    assert not [finding for finding in verify(recording.path) if finding.level == "error"]


@pytest.mark.parametrize("frozen_s", [(0.2, 0.45), (0.4, 0.8), (1.0, 2.0), (1.9, 2.3)])
def test_what_comes_late_from_a_frozen_device_is_not_lost(frozen_s: tuple[float, float], tmp_path: Path) -> None:
    """At arming, at the first sample, in the last second, at the last sample and after it."""
    rig = make_rig(dict.fromkeys(("touch", "laser"), "sim:"), "screen-1", 1, fast=False)
    now_s = rig.stage.time_base.now()
    sources = tuple(Frozen(source, *(now_s + t_s for t_s in frozen_s)) for source in rig.sources)
    recording = Recording(protocol(300, duration_s=1.5), Rig(sources, rig.stage), tmp_path / "s.h5")
    assert recording.error is None
    (run,) = read_session(recording.path).runs
    truth = rig.stage.players["sim"].truth[0]
    assert run.outcome == "complete"
    assert (run.touch.dropped, run.laser.missed) == (0, 0)
    end_s = run.start_s + run.duration_s
    np.testing.assert_array_equal(run.touch.t_s[run.touch.t_s <= end_s], truth.touch.t_s[truth.touch.t_s <= end_s])
    assert len(run.laser.t_s) >= (truth.laser.t_s <= end_s).sum()


def touch(*t_s: float) -> TouchTrace:
    return TouchTrace(np.array(t_s), np.arange(len(t_s), dtype=float), np.zeros(len(t_s)))


def test_samples_whose_stamps_cannot_be_are_left_out_and_counted() -> None:
    order = Order()
    first = order.kept(Batch(1.0, touch=touch(0.1, 0.2, np.nan, 0.15, 1e18, 0.3)))
    assert first.touch is not None
    assert first.touch.t_s.tolist() == [0.1, 0.2, 0.3]
    assert first.touch.x_mm.tolist() == [0.0, 1.0, 5.0]
    assert first.touch.dropped == 3
    assert first.touch.gaps_s.tolist() == [[1.0, 1.0]]
    assert len(first.notices) == 1
    second = order.kept(Batch(2.0, touch=touch(0.25, 1.5)))
    assert second.touch is not None
    assert (second.touch.t_s.tolist(), second.touch.dropped) == ([1.5], 1)
    assert second.notices == ()  # it was said


def test_an_edge_that_a_refined_clock_maps_a_little_back_stays() -> None:
    edges = LaserTrace(np.array([1.0, 1.1, 1.0995, 1.2]), np.array([1, 0, 1, 0]), device_t_s=np.arange(4.0))
    kept = Order().kept(Batch(2.0, laser=edges)).laser
    assert kept is not None
    assert kept.t_s.tolist() == [1.0, 1.1, 1.1, 1.2]
    assert kept.device_t_s.tolist() == [0.0, 1.0, 2.0, 3.0]
    assert kept.missed == 0


def test_a_device_that_never_speaks_again_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(watch, "STUCK_S", 0.2)
    rig = fast_rig()
    sources = tuple(Frozen(s, 2.0, np.inf) if s.role == "laser" else s for s in rig.sources)
    recording = Recording(protocol(300, 600), Rig(sources, rig.stage), tmp_path / "s.h5")
    assert recording.error is None
    assert [run.outcome for run in read_session(recording.path).runs] == ["device_lost"]
    assert "laser source does not report any more" in recording.events[-1].problem


@pytest.fixture(scope="module")
def steady(tmp_path_factory: pytest.TempPathFactory) -> Analysis:
    """Of a session without any trouble."""
    return analyze(record(tmp_path_factory.mktemp("steady"), {})[1])


def test_a_clock_that_drifts_by_200_ppm_costs_the_latency_nothing(steady: Analysis, tmp_path: Path) -> None:
    rig = fast_rig()
    world = rig.stage.players["sim"]
    world.clocks["laser"] = DeviceClock(world.clocks["laser"].offset_s, 200e-6)
    drifting = read_session(Recording(protocol(300, 600), rig, tmp_path / "drifting.h5").path)
    for one, other in zip(analyze(drifting).runs, steady.runs, strict=True):
        assert one.latency_s == pytest.approx(other.latency_s, abs=5e-4)


@pytest.mark.parametrize("moment", MOMENTS)
def test_a_clock_that_begins_to_drift_keeps_the_latency_in_its_interval(
    moment: str, steady: Analysis, tmp_path: Path
) -> None:
    _, drifting = record(tmp_path, {"laser": ("drifting", moment)})
    for one, other in zip(analyze(drifting).runs, steady.runs, strict=True):
        # A clock that changes its rate within a run is no line: what it leaves open is in the interval.
        low_s, high_s = one.latency_ci95_s
        assert low_s < other.latency_s < high_s
        if moment != "middle":
            assert one.latency_s == pytest.approx(other.latency_s, abs=5e-4)


@pytest.mark.wire
@pytest.mark.skipif(bool(ethercat.why_not()), reason=f"no EtherCAT segment here: {ethercat.why_not()}")
def test_a_terminal_unplugged_at_arming_and_before_the_last_sample_costs_no_run(tmp_path: Path) -> None:
    """On the emulated bus, with the real driver."""
    # Plugged back once the loss is noticed and the run has begun: a countdown may be over at once, or outlast the loss.
    lost = begun = False
    with ethercat.start_segment("moment") as segment:

        def unplug() -> None:
            segment.order("unplug", slaves=1)

        def disturb(control: Control, event: events.Event) -> None:
            nonlocal lost, begun
            if isinstance(event, events.StateChanged) and event.run_number == 1 and event.phase is Phase.COUNTDOWN:
                begun = False
                unplug()
            if isinstance(event, events.RunStarted):
                begun = True
                if event.run_id == "run-02":  # well before its end: what comes after the last sample is no loss
                    threading.Timer(1.0, unplug).start()
            lost = lost or (isinstance(event, events.NoticeRaised) and (event.source, event.state) == ("laser", "lost"))
            if lost and begun:
                lost = False
                segment.order("plug")

        rig = make_rig({"touch": "sim:", "laser": f"ethercat:{segment.iface}?channel=1"}, "screen-1", 1, fast=False)
        plan = protocol(300, 600, 450, duration_s=2.0)
        recording = Recording(plan, rig, tmp_path / "s.h5", disturb)
    assert recording.error is None, recording.error
    session = read_session(recording.path)
    assert [run.outcome for run in session.runs] == ["complete"] * 3
    for run in session.runs[:2]:
        assert len(run.laser.gaps_s), f"{run.id} does not say that the laser was away"
        assert any(entry.source == "laser" and entry.level == "error" for entry in run.log), run.log
    assert not len(session.runs[2].laser.gaps_s)
    assert [notice.state for notice in recording.of(events.NoticeRaised) if notice.source == "laser"].count("back") == 2
