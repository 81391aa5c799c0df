"""The EtherCAT laser's reasoning without a wire: edges from images, refused cycles, addresses, the launcher."""

from __future__ import annotations

import errno
import struct
from pathlib import Path

import numpy as np
import pytest

from draglag_devices.ethercat_laser import helper, preflight
from draglag_devices.ethercat_laser.bus import Cycle
from draglag_devices.ethercat_laser.clockwatch import ClockWatch, Pair
from draglag_devices.ethercat_laser.disturbed import Disturbances
from draglag_devices.ethercat_laser.edges import EdgeFinder, Sample, decode
from draglag_devices.ethercat_laser.watch import BAD_CYCLES, Epoch, Found
from draglag_devices.opening import open_source
from draglag_devices.source import DeviceError
from emulators.ethercat.terminals import ek1101, el1252

US, MS, S = 1_000, 1_000_000, 1_000_000_000
BURST = ((0, 1), (40 * US, 0), (80 * US, 1), (10 * MS, 0))


def image(level: int, rise_ns: int = 0, fall_ns: int = 0) -> bytes:
    """Channel 1 as given; everything of channel 2, and the unused bits, set to what must not matter."""
    return struct.pack("<BBBQQQQ", level | 0xFE, 0xFF, 0xFF, rise_ns, fall_ns, 77, 88)


def test_only_the_two_input_bits_count() -> None:
    assert decode(image(0, 5, 6), 1) == Sample(0, 5, 6)
    assert decode(image(1, 5, 6), 2) == Sample(1, 77, 88)
    with pytest.raises(struct.error):
        decode(b"\0" * 34, 1)


def test_edges_come_in_order_of_their_stamps_and_the_first_image_is_no_edge() -> None:
    finder = EdgeFinder(Sample(0, 900, 950))
    assert finder.take(Sample(0, 900, 950)) == ([], 0)
    assert finder.take(Sample(0, 1000, 1200)) == ([(1000, 1), (1200, 0)], 0)
    assert finder.take(Sample(1, 1300, 1200)) == ([(1300, 1)], 0)


def test_two_edges_of_one_direction_prove_a_lost_one() -> None:
    finder = EdgeFinder(Sample(0, 0, 0))
    # Rise, fall, rise within one cycle: the first rise is overwritten.
    assert finder.take(Sample(1, 300, 200)) == ([(200, 0), (300, 1)], 1)
    # Fall and rise between two cycles, of which the fall's stamp was never seen.
    assert finder.take(Sample(1, 500, 200)) == ([(500, 1)], 1)


def test_a_level_may_lag_a_cycle_but_not_stay_wrong() -> None:
    finder = EdgeFinder(Sample(0, 0, 0))
    assert finder.take(Sample(0, 100, 0)) == ([(100, 1)], 0)
    assert finder.take(Sample(1, 100, 0)) == ([], 0)
    missed = [finder.take(Sample(0, 100, 0))[1] for _ in range(10)]
    assert sum(missed) == 1


def cycle(host_ns: int, dc_ns: int | None = None, wkc: int = 2, rise_ns: int = 0, trip_ns: int = 100 * US) -> Cycle:
    """The DC clock is 3 s ahead of the host unless given."""
    dc_ns = host_ns + trip_ns // 2 + 3 * S if dc_ns is None else dc_ns
    return Cycle(wkc, Pair(dc_ns, host_ns, host_ns + trip_ns), image(int(rise_ns > 0), rise_ns))


def running() -> Epoch:
    epoch = Epoch(0, 1, 2)
    for k in range(1, 50):
        assert epoch.take(cycle(k * MS)) == Found([])
    return epoch


def test_only_the_expected_working_counter_is_accepted() -> None:
    epoch = running()
    for wkc, why in ((-1, "lost"), (1, "counter"), (3, "counter"), (0, "counter")):
        assert epoch.take(cycle(60 * MS, wkc=wkc)) is None
        assert epoch.why == why
    assert epoch.bad == 4
    assert epoch.good_ns == 49 * MS
    assert epoch.take(cycle(70 * MS)) is not None
    assert epoch.bad == 0
    assert dict(epoch.counts) == {"lost": 1, "counter": 3}


def test_the_reason_is_not_hidden_by_answers_that_a_busy_computer_loses() -> None:
    epoch = running()
    for k, wkc in enumerate((1, -1, 1, -1, -1, 1, -1, -1)):
        assert epoch.take(cycle((60 + k) * MS, wkc=wkc)) is None
    assert epoch.why == "counter"
    assert epoch.take(cycle(70 * MS)) is not None
    assert epoch.take(cycle(71 * MS, wkc=-1)) is None
    assert epoch.why == "lost"


def test_old_frames_with_a_right_counter_are_refused() -> None:
    epoch = running()
    for k in range(50, 50 + BAD_CYCLES):
        assert epoch.take(cycle(k * MS, dc_ns=(k - 16) * MS + 3 * S)) is None
    assert epoch.why == "stale"
    assert epoch.bad == BAD_CYCLES


def test_a_clock_that_stands_still_or_starts_again_is_refused() -> None:
    epoch = running()
    assert epoch.take(cycle(50 * MS, dc_ns=49 * MS + 50 * US + 3 * S)) is None
    assert epoch.take(cycle(51 * MS, dc_ns=1)) is None
    assert set(epoch.counts) == {"stale"}


def test_a_stall_of_the_computer_is_no_fault() -> None:
    epoch = running()
    assert epoch.take(cycle(75 * MS, trip_ns=25 * MS)) is not None
    assert epoch.take(cycle(101 * MS)) is not None


@pytest.mark.parametrize("stamp_ns", [17, 60 * MS + 4 * S])
def test_stamps_before_the_last_cycle_or_ahead_of_the_clock_are_refused(stamp_ns: int) -> None:
    epoch = running()
    assert epoch.take(cycle(50 * MS, rise_ns=stamp_ns)) is None
    assert epoch.why == "stamp"


def test_a_drifting_quartz_is_followed() -> None:
    watch = ClockWatch()
    rng = np.random.default_rng(2)
    for k in range(1, 60_000, 7):
        host_ns, trip_ns = k * MS, int(rng.integers(80, 2000)) * US
        dc_ns = int((host_ns + trip_ns * rng.uniform(0.1, 0.9)) * (1 + 80e-6)) + 5 * S
        pair = Pair(dc_ns, host_ns, host_ns + trip_ns)
        assert watch.fits(pair)
        watch.add(pair)
    best = watch.take_best()
    assert best is not None
    assert best.width_ns < 100 * US
    assert watch.take_best() is None


@pytest.mark.parametrize("options", ["channel=3", "channel=one", "chanel=1", "light=bright"])
def test_options_that_make_no_sense_are_refused(options: str) -> None:
    with pytest.raises(DeviceError):
        open_source(f"ethercat:eth9?{options}", "laser")


def test_the_bus_serves_as_laser_only() -> None:
    with pytest.raises(DeviceError, match="cannot serve as touch"):
        open_source("ethercat:eth9?channel=1", "touch")


def test_without_rights_the_installed_launcher_is_used(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    launcher = tmp_path / "draglag-ethercat-master"
    monkeypatch.setattr(helper, "LAUNCHERS", (launcher,))
    monkeypatch.setattr(helper, "has_rights", lambda: False)
    assert "-m" in helper.command("eth1")  # which then says itself what is missing
    launcher.write_text("#!/bin/sh\n")
    launcher.chmod(0o755)
    assert helper.command("eth1", "--channel", "2") == [str(launcher), "eth1", "--channel", "2"]
    monkeypatch.setattr(helper, "has_rights", lambda: True)
    assert helper.command("eth1")[0] != str(launcher)


def paused(pause_ns: int, rise_ns: int, fall_ns: int) -> Found:
    """What is found in the cycle ``pause_ns`` after the last; stamps count from that one's DC time (0: as before)."""
    epoch = Epoch(0, 1, 2)
    last_dc_ns = 49 * MS + 50 * US + 3 * S
    for k in range(1, 50):
        assert epoch.take(cycle(k * MS)) == Found([])
    stamps = [last_dc_ns + stamp if stamp else 0 for stamp in (rise_ns, fall_ns)]
    at = cycle(49 * MS + pause_ns)
    found = epoch.take(Cycle(at.wkc, at.pair, image(int(rise_ns > fall_ns), *stamps)))
    assert found is not None
    return found


def test_one_new_stamp_is_the_only_edge_however_long_the_pause() -> None:
    assert paused(40 * MS, 0, 0) == Found([])
    assert paused(40 * MS, 30 * MS, 0).unverified_ns is None
    assert paused(40 * MS, 0, 30 * MS).unverified_ns is None


def test_before_two_new_stamps_of_a_pause_any_number_of_pairs_may_be_lost() -> None:
    found = paused(12 * MS, 5 * MS, 9 * MS)
    assert [level for _, level in found.edges] == [1, 0]
    assert found.missed == 0
    assert found.unverified_ns is not None
    start, end = found.unverified_ns
    # From the last cycle to the rising edge, which is nothing but 5 ms later by the bus's clock.
    assert start == 49 * MS
    assert 54 * MS <= end <= 54 * MS + 200 * US


def test_a_pair_may_be_lost_before_two_new_stamps_however_soon_after_the_last_cycle_they_come() -> None:
    found = paused(12 * MS, 300 * US, 9 * MS)
    assert found.missed == 0
    assert found.unverified_ns is not None
    start, end = found.unverified_ns
    assert start == 49 * MS
    assert 49 * MS + 300 * US <= end <= 49 * MS + 500 * US
    # Two falling edges in a row prove a rising one between them.
    lost = paused(12 * MS, 9 * MS, 300 * US)
    assert lost.missed == 1
    assert lost.unverified_ns is not None


@pytest.mark.parametrize("share", [0.0, 0.01, 0.05, 0.3])
def test_no_edge_of_a_burst_is_lost_without_count_or_mark_wherever_cycles_are_late(share: float) -> None:
    """Three edges within 80 us, of which a cycle shows two, and a fourth 10 ms later; ``share`` of the cycles late."""
    rng = np.random.default_rng(round(1000 * share))
    coupler, (terminal, inputs) = ek1101(12e-6), el1252(-20e-6)
    for slave in (coupler, terminal):
        slave.power_on(0)
    terminal.put(0x0980, 0x0100, 2)  # the latch unit is on
    bursts = np.cumsum(20 * MS + rng.integers(0, MS, 400)).tolist()
    inputs.add([(burst + at, 1, level) for burst in bursts for at, level in BURST])
    epoch, now_ns, done = Epoch(0, 1, 2), MS, 0
    lost_in_all = 0
    while now_ns < bursts[-1] + 40 * MS:
        inputs.advance(now_ns)
        pair = Pair(coupler.system_time(now_ns), now_ns - int(rng.integers(20, 60)) * US, now_ns + 90 * US)
        terminal.write(0x0910, pair.dc_ns.to_bytes(8, "little"), now_ns)
        found = epoch.take(
            Cycle(2, pair, (terminal.read(0x1000, 1, now_ns) or b"") + bytes(terminal.memory[0x09AE:0x09D0]))
        )
        assert found is not None
        stamps = {stamp for stamp, _ in found.edges}
        lost = [edge for edge in inputs.done[done:] if edge.stamp_ns not in stamps]
        start, end = found.unverified_ns or (0, 0)
        assert len([edge for edge in lost if not start <= edge.t_ns <= end]) <= found.missed <= len(lost)
        done, lost_in_all = len(inputs.done), lost_in_all + len(lost)
        now_ns += int(MS + rng.choice([2, 12, 25]) * MS * rng.random()) if rng.random() < share else MS
    assert done == 4 * len(bursts)
    assert lost_in_all > 0.8 * len(bursts)


def test_two_edges_in_a_cycle_that_was_in_time_are_all_there_were() -> None:
    assert paused(MS, 400 * US, 700 * US).unverified_ns is None


def test_nothing_is_sure_after_a_pause_in_which_the_devices_were_not_watched() -> None:
    assert paused(400 * MS, 0, 0).unverified_ns == (49 * MS, 449 * MS + 100 * US)


def test_one_lost_cycle_in_a_thousand_is_counted_and_no_warning() -> None:
    disturbances = Disturbances()
    said = [disturbances.take(t_s, t_s + 1.0, 1000, {"lost": 1}) for t_s in range(150)]
    notices = [notice for notice in (*said, disturbances.rest(150.0)) if notice is not None]
    assert [notice.level for notice in notices] == ["info"] * 3
    assert notices[0].text.startswith(
        "0.1 % of the EtherCAT cycles of the last 60 s were disturbed: 60 without an answer."
    )
    assert sum(int(notice.text.split(": ")[1].split()[0]) for notice in notices) == disturbances.total["lost"] == 150
    assert disturbances.rest(151.0) is None


def test_many_disturbed_cycles_are_a_warning_at_once_and_then_one_in_ten_seconds() -> None:
    disturbances = Disturbances()
    said = [disturbances.take(t_s, t_s + 1.0, 900, {"lost": 20, "stale": 10}) for t_s in range(25)]
    notices = [(k, notice) for k, notice in enumerate(said) if notice is not None]
    assert [(k, notice.level) for k, notice in notices] == [(0, "warning"), (10, "warning"), (20, "warning")]
    assert "3.3 % of the EtherCAT cycles of the last 1 s were disturbed: 20 without an answer, 10 with old data" in (
        notices[0][1].text
    )
    assert "200 without an answer, 100 with old data" in notices[1][1].text
    assert "Close other programs" in notices[1][1].text


@pytest.mark.parametrize(
    ("state", "words"),
    [
        (None, "the network interface eth9 is gone: its adapter was unplugged or it was deleted"),
        (
            (0, False),
            "the network interface eth9 was switched off (switch it on as administrator: sudo ip link set eth9 up)",
        ),
        ((1, False), "the cable on eth9 is unplugged or the other end is off"),
        ((1, True), ""),
    ],
)
def test_deleted_switched_off_and_unplugged_are_different_sentences(
    monkeypatch: pytest.MonkeyPatch, state: tuple[int, bool] | None, words: str
) -> None:
    def link_state(interface: str) -> tuple[int, bool]:
        if state is None:
            raise OSError(errno.ENODEV, "No such device")
        return state

    monkeypatch.setattr(preflight, "link_state", link_state)
    assert preflight.link_trouble("eth9") == words


@pytest.mark.parametrize("position", ["position=0", "position=1", "position=two", "position="])
def test_a_position_that_makes_no_sense_is_refused(position: str) -> None:
    with pytest.raises(DeviceError, match="no place on the line"):
        open_source(f"ethercat:eth9?channel=1&{position}", "laser")
