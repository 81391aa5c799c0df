"""The EtherCAT laser through pysoem and a real veth pair: bring-up, exact edges, clocks, refusals, release."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import time

import numpy as np
import pytest

from devices.ethercat_rig import MS, Recording, blink, needs_segment, segment_name
from draglag_devices.addresses import open_source
from draglag_devices.discovery import discover
from draglag_devices.ethercat_laser import helper
from draglag_devices.ethercat_laser.preflight import other_master
from draglag_devices.source import DeviceError
from emulators.ethercat import Segment, running_segment

pytestmark = needs_segment


def test_every_edge_arrives_with_the_very_stamp_the_terminal_gave_it(segment: Segment) -> None:
    rng = np.random.default_rng(5)
    script, at_ns = [], 20 * MS
    for _ in range(25):
        for level in (1, 0):
            script.append((at_ns, 1, level))
            # Longer than a busy computer keeps the bus waiting; what is lost when it does is counted, below.
            at_ns += int(rng.integers(40 * MS, 70 * MS))
    with Recording(segment) as rec:
        start_ns = segment.edges(script, relative=True)
        rec.read_past(start_ns + at_ns)
        # Disturbed cycles are told within a second.
        rec.read_past(time.monotonic_ns() + 1100 * MS)
        true = rec.true_edges()
    assert [edge[2] for edge in true] == list(rec.laser.light)
    assert [edge[3] for edge in true] == rec.stamps_ns()
    assert rec.laser.missed == 0
    # A gap is marked where this machine was too busy to answer for long, and nowhere else.
    assert len(rec.laser.gaps_s) == 0 or rec.source.disturbed.get("lost", 0) > 0
    # 1 ms is what the design warns at; round trips here are ten times shorter.
    assert np.abs(rec.laser.t_s - np.array([edge[0] for edge in true]) * 1e-9).max() < 1e-3


def test_clock_pairs_hold_the_true_time_between_them(segment: Segment) -> None:
    with Recording(segment) as rec:
        rec.read_until(lambda: len(rec.clocks) >= 4)
        start_ns = segment.edges(blink(1, 10 * MS, 5 * MS, 5 * MS), relative=True)
        rec.read_past(start_ns + 20 * MS)
        (host_ns, _, _, stamp_ns), *_ = rec.true_edges()
    offset_s = host_ns * 1e-9 - (stamp_ns - rec.zero_ns) * 1e-9
    for bounds in rec.clocks:
        # Two quartzes of the segment differ from the host by up to 20 ppm over the second this takes.
        assert (bounds.host_min_s - 5e-5 <= bounds.device_s + offset_s).all()
        assert (bounds.device_s + offset_s <= bounds.host_max_s + 5e-5).all()
        assert set(bounds.epoch) == {0}


def test_a_comparison_that_is_asked_for_is_made_after_that_and_not_waited_for_when_the_bus_is_away(
    segment: Segment,
) -> None:
    with Recording(segment) as rec:
        rec.read_until(lambda: len(rec.clocks) >= 1)
        asked_s = time.monotonic()
        done = rec.source.synchronise()
        rec.read_until(done.is_set)
        assert rec.clocks[-1].host_max_s[-1] >= rec.clocks[-1].host_min_s[-1] >= asked_s
        segment.order("unplug")
        rec.read_until(lambda: not rec.alive)
        rec.read_until(rec.source.synchronise().is_set)
        assert not rec.alive
        segment.order("plug")


def test_the_second_channel_is_another_input(segment: Segment) -> None:
    with Recording(segment, "?channel=2") as rec:
        script = blink(3, 20 * MS, 7 * MS, 10 * MS, channel=2) + blink(5, 11 * MS, 5 * MS, 10 * MS, channel=1)
        start_ns = segment.edges(script, relative=True)
        rec.read_past(start_ns + 80 * MS)
        true = rec.true_edges(channel=2)
    assert rec.stamps_ns() == [edge[3] for edge in true]
    assert len(true) == 6


def test_light_low_inverts_what_an_edge_means(segment: Segment) -> None:
    with Recording(segment, "?channel=1&light=low") as rec:
        start_ns = segment.edges(blink(2, 20 * MS, 7 * MS, 10 * MS), relative=True)
        rec.read_past(start_ns + 60 * MS)
    assert list(rec.laser.light) == [0, 1, 0, 1]


def test_edges_too_fast_for_one_stamp_per_cycle_are_counted(segment: Segment) -> None:
    bursts = 20
    # 137 us more than whole cycles: bursts fall all over the cycle, and most of them inside one.
    period_ns = 20 * MS + 137_000
    script = [(period_ns * (k + 1) + at, 1, level) for k in range(bursts)
              for at, level in ((0, 1), (40_000, 0), (80_000, 1), (10 * MS, 0))]  # fmt: skip
    with Recording(segment) as rec:
        start_ns = segment.edges(script, relative=True)
        rec.read_past(start_ns + period_ns * (bursts + 1) + 10 * MS)
        true = rec.true_edges()
    assert len(rec.laser.light) + rec.laser.missed == len(true) == 4 * bursts
    assert rec.laser.missed > 0
    assert any("too fast" in text for text in rec.texts)


def test_a_level_that_was_there_before_is_no_edge(segment: Segment) -> None:
    segment.order("edges", edges=[[0, 1, 1]])
    with Recording(segment) as rec:
        start_ns = segment.edges([(10 * MS, 1, 0)], relative=True)
        rec.read_past(start_ns + 20 * MS)
    assert rec.info.details["level_at_start"] == 1
    assert list(rec.laser.light) == [0]


def _refusal(address: str) -> DeviceError:
    source = open_source(address, "laser")
    with pytest.raises(DeviceError) as caught:
        source.open()
    source.close()
    return caught.value


def test_each_reason_not_to_start_has_its_own_sentence_and_remedy(
    segment: Segment, monkeypatch: pytest.MonkeyPatch
) -> None:
    address = f"ethercat:{segment.iface}?channel=1"
    refusals = {"no interface": _refusal("ethercat:dl-none?channel=1")}
    segment.order("unplug", slaves=0)
    refusals["no slaves"] = _refusal(address)
    segment.order("identity", terminal=0x03F03052)
    refusals["wrong slaves"] = _refusal(address)
    segment.order("identity")
    with Recording(segment):
        refusals["in use"] = _refusal(address)
    segment.order("link", up=0)
    refusals["no carrier"] = _refusal(address)
    segment.order("link", up=1)
    subprocess.run(["ip", "link", "set", segment.iface, "down"], check=True)
    refusals["down"] = _refusal(address)
    subprocess.run(["ip", "link", "set", segment.iface, "up"], check=True)
    if shutil.which("setpriv"):
        unprivileged = ["setpriv", "--bounding-set", "-net_raw,-net_admin", "--inh-caps", "-net_raw,-net_admin"]
        plain = helper.command
        monkeypatch.setattr(helper, "command", lambda *arguments: [*unprivileged, *plain(*arguments)])
        refusals["no rights"] = _refusal(address)
    expected = {"no interface": "no network interface called", "no slaves": "no EtherCAT device answers",
                "wrong slaves": "not an EK1101 with an EL1252", "in use": "in use by another program",
                "no carrier": "no carrier", "down": "switched off", "no rights": "no right to send"}  # fmt: skip
    for case, error in refusals.items():
        assert expected[case] in error.problem, case
        assert error.remedy, case
    assert len({error.problem for error in refusals.values()}) == len(refusals)
    assert len({error.remedy for error in refusals.values()}) == len(refusals)


@pytest.mark.parametrize("register", [0x0981, 0x0600, 0x0610], ids=["latch unit", "first mapping", "second mapping"])
def test_a_terminal_that_does_not_keep_its_set_up_is_not_used(segment: Segment, register: int) -> None:
    segment.order("stubborn", address=register, length=1 if register == 0x0981 else 16)
    assert "does not keep its set-up" in _refusal(f"ethercat:{segment.iface}?channel=1").problem


def test_the_segment_has_the_trap_that_the_driver_avoids(segment: Segment) -> None:
    """What a master without the two extra steps sees: a true input, a right counter, and no stamps."""
    import pysoem

    master = pysoem.Master()
    master.open(segment.iface)
    try:
        master.manual_state_change = 1
        assert master.config_init() == 2
        for state in (pysoem.PREOP_STATE, pysoem.SAFEOP_STATE, pysoem.OP_STATE):
            if state == pysoem.SAFEOP_STATE:
                assert master.config_map() == 37
                assert master.config_dc()
            master.state = state
            master.write_state()
            assert master.state_check(state, 200_000) == state
        segment.order("edges", edges=[[0, 1, 1]])
        master.send_processdata()
        assert master.receive_processdata(100_000) == master.expected_wkc == 2
        assert master.slaves[1].input == b"\x01" + bytes(34)
        assert segment.order("log")["edges"][-1][3] is None
    finally:
        master.close()


def test_a_foreign_master_on_the_interface_is_noticed(segment: Segment) -> None:
    with socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(0x88A4)) as foreign:
        foreign.bind((segment.iface, 0x88A4))
        assert "in use" in _refusal(f"ethercat:{segment.iface}?channel=1").problem


def test_discovery_finds_the_bus_and_leaves_it_alone(segment: Segment) -> None:
    before = segment.order("register", address=0x0130, length=2)["value"]
    found = {device.address: device for device in discover()}
    device = found[f"ethercat:{segment.iface}?channel=1"]
    assert device.usable
    assert device.roles == ("laser",)
    assert segment.order("register", address=0x0130, length=2)["value"] == before
    with Recording(segment) as rec:
        busy = next(d for d in discover() if d.address == device.address)
        assert not busy.usable
        assert "in use" in busy.description
        assert not rec.source.read(0.1).notices


def test_closing_releases_process_socket_and_files(segment: Segment) -> None:
    def descriptors() -> int:
        return len(os.listdir("/proc/self/fd"))

    before = descriptors()
    for _ in range(3):
        with Recording(segment) as rec:
            process = rec.source._process
            rec.source.read(0.1)
        rec.source.close()
        assert process.poll() == 0
        assert not other_master(segment.iface)
    assert descriptors() <= before
    with pytest.raises(DeviceError):
        rec.source.read(0.0)


def test_the_terminal_is_left_in_init(segment: Segment) -> None:
    with Recording(segment):
        assert segment.order("register", address=0x0130, length=1)["value"] == "08"
        assert segment.order("register", address=0x0981, length=1)["value"] == "01"
    assert segment.order("register", address=0x0130, length=1)["value"] == "01"


def test_a_bus_process_that_is_not_listened_to_ends_by_itself(segment: Segment) -> None:
    command = [sys.executable, "-P", "-m", "draglag_devices.ethercat_laser.master", segment.iface]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert process.stdout is not None
    assert process.stdin is not None
    assert b'"ready"' in process.stdout.readline()
    process.stdin.close()
    assert process.wait(10) == 0
    process.stdout.close()


def test_namespace_and_cable_go_with_the_segment() -> None:
    with running_segment(segment_name("g")) as segment:
        names = (segment.iface, segment.namespace, segment._folder)
        assert names[1] in subprocess.run(["ip", "netns"], capture_output=True, text=True, check=True).stdout
    assert names[0] not in [name for _, name in socket.if_nameindex()]
    assert names[1] not in subprocess.run(["ip", "netns"], capture_output=True, text=True, check=True).stdout
    assert not names[2].exists()
