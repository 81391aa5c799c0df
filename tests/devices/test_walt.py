"""The WALT driver against byte-exact conversations and an emulated WALT on stepped time."""

import errno
from itertools import pairwise

import numpy as np
import pytest
import serial

from draglag.instruments.clocks import fit_clocks
from draglag.recording import ClockBounds, LaserTrace, concatenate
from draglag_app.session.taps import AHEAD_S, TapPairer
from draglag_devices import walt as driver
from draglag_devices.addresses import parse_address
from draglag_devices.opening import open_source
from draglag_devices.source import ContactChanges, DeviceError
from draglag_devices.walt import port, protocol
from draglag_devices.walt.connect import greet
from draglag_devices.walt.link import Link, NoAnswer
from draglag_devices.walt.port import PortGone
from draglag_devices.walt.source import WaltSource
from emulators.walt.wires import SteppedWire


def on_wire(wire, role="laser", address="serial:/dev/ttyACM0"):
    return WaltSource(parse_address(address), role, lambda path: wire, wire.now, wire.pause)


class Script:
    """A port that expects these bytes, one write after the other, and answers with those."""

    def __init__(self, *exchanges):
        self.expected = list(exchanges)
        self.answer = b""
        self.t_s = 10.0

    def now(self):
        self.t_s += 1e-6
        return self.t_s

    def pause(self, duration_s):
        self.t_s += duration_s

    def write(self, data):
        sent, answer = self.expected.pop(0)
        assert data == sent
        self.answer += answer

    def read(self, timeout_s):
        data, self.answer = self.answer, b""
        self.t_s += 1e-4 if data else timeout_s
        return data

    def close(self):
        pass


@pytest.mark.parametrize(("role", "last"), [("laser", "FLJP"), ("walt", "G")])
def test_opening_is_this_conversation_and_no_other(role, last):
    wire = SteppedWire()
    info = on_wire(wire, role).open()
    assert wire.firmware.commands == "VlcFZ" + 7 * ("123456789" + "RRRRRRRRR" + "I" + "RRRRRRRRR") + last
    assert info.details["firmware"] == "6"


def test_greeting_byte_by_byte():
    script = Script((b"V", b"v 6\n"), (b"l", b"L\n"), (b"c", b"C\n"), (b"F", b"f\n"))
    assert greet(Link(script, script.now, script.pause), "serial:x") == "6"
    assert script.expected == []


@pytest.mark.parametrize(
    ("parse", "line", "value"),
    [
        (protocol.parse_trigger, "G L -2147483648 1 3", protocol.Trigger("L", -(2**31), 1, 3)),
        (protocol.parse_trigger, "G S 17 0 1", protocol.Trigger("S", 17, 0, 1)),
        (protocol.parse_trigger, "G L 17 0", None),
        (protocol.parse_trigger, "G L 1x7 0 1", None),
        (protocol.parse_time, "t -5", -5),
        (protocol.parse_time, "t", None),
        (protocol.parse_sync, "10:0", (10, 0)),
        (protocol.parse_sync, "3:-77", (3, -77)),
        (protocol.parse_sync, "3", None),
        (protocol.parse_shock, "0", 0),
        (protocol.parse_shock, "-123", -123),
        (protocol.parse_shock, "t 5", None),
        (protocol.parse_version, "v 6", "6"),
    ],
)
def test_lines_are_read_exactly_or_not_at_all(parse, line, value):
    assert parse(line) == value


def test_the_32_bit_count_is_unwrapped_and_a_late_stamp_is_no_wrap():
    unwrapped = protocol.Unwrapped()
    for minutes in (0, 30, 60, 71, 72, 100, 130, 144):
        true_us = minutes * 60_000_000
        raw = (true_us + 2**31) % 2**32 - 2**31
        assert unwrapped(raw) == pytest.approx(minutes * 60)
        unwrapped.advance(minutes * 60)
        assert unwrapped((true_us - 5_000_000 + 2**31) % 2**32 - 2**31) == pytest.approx(minutes * 60 - 5)


def test_every_command_is_answered_as_the_table_says():
    wire = SteppedWire()
    link = Link(wire, wire.now, wire.pause)
    for command in "ZPDFLlCc":
        assert link.acknowledged(command).value == command.swapcase()
    assert link.ask("x", lambda text: text).value == "Unknown command: x"


def read_until(source, wire, to_s, step_s=0.1):
    """All batches up to a time."""
    batches = []
    while wire.t_s < to_s:
        batches.append(source.read(step_s))
    return batches


def edges_of(batches):
    parts = [b.laser for b in batches if b.laser is not None]
    return concatenate(parts) if parts else LaserTrace(np.empty(0), np.empty(0, np.int64))


def notices_of(batches):
    return [n.text for b in batches for n in b.notices]


@pytest.mark.parametrize(("drift", "jitter_s"), [(0.0, 0.0), (40e-6, 0.0), (-25e-6, 3e-4), (10e-6, 2e-3)])
def test_bounds_hold_the_truth_whatever_the_delays_and_the_edges_land_within_them(drift, jitter_s):
    wire = SteppedWire(drift=drift, seed=4)
    wire.firmware.faults.jitter_s = jitter_s
    source = on_wire(wire)
    source.open()
    start_s = wire.t_s
    true_s = start_s + 1.0 + np.sort(np.random.default_rng(2).uniform(0, 58, 100))
    for k, at_s in enumerate(true_s):
        wire.at(at_s, lambda firmware, t, k=k: firmware.edge(t, k % 2))
    batches = read_until(source, wire, start_s + 60)
    bounds = concatenate([b.clock for b in batches if b.clock is not None])
    exact = np.array([wire.firmware.host_s(s) for s in bounds.device_s])
    assert (bounds.host_min_s <= exact + 1e-9).all()
    assert (exact <= bounds.host_max_s + 1e-9).all()
    laser = edges_of(batches)
    assert laser.missed == 0
    assert laser.light.tolist() == [k % 2 for k in range(100)]
    fit = fit_clocks([bounds])["laser"]
    host_s, width_s = fit.map_to_host(laser.device_t_s, laser.epoch)
    # A stamp is cut to a microsecond.
    assert (np.abs(host_s - true_s) <= width_s + 1e-6).all()
    assert width_s.max() < 1e-3
    clock = fit.epochs[0]
    assert clock.drift_interval[0] <= -drift / (1 + drift) <= clock.drift_interval[1]


def test_eighty_minutes_pass_two_signs_and_a_wrap():
    wire = SteppedWire(drift=15e-6)
    source = on_wire(wire)
    source.open()
    start_s = wire.t_s
    true_s = start_s + np.arange(60.0, 4800.0, 97.0)
    for k, at_s in enumerate(true_s):
        wire.at(at_s, lambda firmware, t, k=k: firmware.edge(t, k % 2))
    batches = read_until(source, wire, start_s + 4800, step_s=5.0)
    laser = edges_of(batches)
    assert len(laser.t_s) == len(true_s)
    assert np.abs(laser.t_s - true_s).max() < 2e-4
    assert (np.diff(laser.device_t_s) > 0).all()
    assert notices_of(batches) == []


def test_edges_too_fast_for_it_are_counted_and_the_gap_is_marked():
    wire = SteppedWire()
    source = on_wire(wire)
    source.open()
    start_s = wire.t_s
    for k, at_s in enumerate((0.1, 0.2, 0.3, 0.300005, 0.300010, 0.4)):
        wire.at(start_s + at_s, lambda firmware, t, k=k: firmware.edge(t, k % 2))
    batches = read_until(source, wire, start_s + 1)
    laser = edges_of(batches)
    assert laser.light.tolist() == [0, 1, 0, 1]
    assert laser.missed == 2
    assert laser.gaps_s - start_s == pytest.approx(np.array([[0.2, 0.30001]]), abs=2e-4)
    assert any("2 edges of the laser were lost" in text for text in notices_of(batches))


@pytest.mark.parametrize("before", [1, 2, 5])
def test_edges_before_it_sends_them_are_not_lost_ones(before):
    wire = SteppedWire()
    start_s = wire.t_s
    # The beam is crossed while the clocks are compared, long before the source is open.
    for k in range(before):
        wire.at(start_s + 0.01 + 0.005 * k, lambda firmware, t, k=k: firmware.edge(t, k % 2))
    source = on_wire(wire)
    source.open()
    assert wire.t_s > start_s + 0.01 + 0.005 * before
    opened_s = wire.t_s
    for k in range(4):
        wire.at(opened_s + 0.1 * (k + 1), lambda firmware, t, k=k: firmware.edge(t, (before + k) % 2))
    laser = edges_of(read_until(source, wire, opened_s + 1))
    assert laser.missed == 0
    assert len(laser.gaps_s) == 0
    assert laser.light.tolist() == [(before + k) % 2 for k in range(4)]


def test_a_line_spoiled_on_the_wire_is_a_missed_edge():
    wire = SteppedWire()
    source = on_wire(wire)
    source.open()
    start_s = wire.t_s
    for k in range(5):
        wire.at(start_s + 0.1 * (k + 1), lambda firmware, t, k=k: firmware.edge(t, k % 2))
    wire.at(start_s + 0.25, lambda firmware, t: setattr(firmware.faults, "corrupt", 1.0))
    wire.at(start_s + 0.35, lambda firmware, t: setattr(firmware.faults, "corrupt", 0.0))
    batches = read_until(source, wire, start_s + 0.8)
    laser = edges_of(batches)
    assert len(laser.t_s) + laser.missed == 5
    assert laser.missed >= 1
    assert len(laser.gaps_s) == 1


def test_noise_on_the_wire_is_reported_and_bends_nothing():
    wire = SteppedWire(drift=20e-6, seed=9)
    source = on_wire(wire)
    source.open()
    wire.firmware.faults.garbage = 0.2
    wire.firmware.faults.corrupt = 0.02
    start_s = wire.t_s
    true_s = start_s + np.arange(0.5, 60.0, 0.5)
    for k, at_s in enumerate(true_s):
        wire.at(at_s, lambda firmware, t, k=k: firmware.edge(t, k % 2))
    batches = read_until(source, wire, start_s + 61)
    laser = edges_of(batches)
    # An edge lost in noise is missed; what was read is right to the clock's uncertainty, but for a spoiled digit.
    assert len(laser.t_s) + laser.missed == len(true_s)
    assert len(laser.t_s) > 0.9 * len(true_s)
    nearest = np.abs(laser.t_s[:, None] - true_s[None, :]).min(axis=1)
    assert np.mean(nearest < 5e-4) > 0.95
    assert all(b.alive for b in batches)
    assert any("could not be read" in text for text in notices_of(batches))


def taps_of(batches):
    return np.concatenate([b.taps.physical_s for b in batches if b.taps is not None])


def rejected_of(batches):
    return [reason for b in batches if b.taps is not None for reason in b.taps.rejected]


def test_shocks_are_polled_each_once_and_ringing_is_counted():
    wire = SteppedWire(drift=-12e-6)
    source = on_wire(wire, "walt")
    source.open()
    start_s = wire.t_s
    true_s = start_s + np.array([0.5, 0.62, 1.7, 1.84, 30.0, 30.2])
    for at_s in true_s:
        wire.at(at_s, lambda firmware, t: firmware.shock(t))
    wire.at(true_s[0] + 0.021, lambda firmware, t: firmware.shock(t))
    batches = read_until(source, wire, start_s + 32)
    shocks = taps_of(batches)
    assert shocks == pytest.approx(true_s, abs=1e-4)
    assert rejected_of(batches) == ["ringing"]
    taps = next(b.taps for b in batches if b.taps is not None)
    assert np.isnan(taps.registered_s).all()
    assert taps.down.tolist() == [-1]
    assert all(late.until_s >= early.until_s for early, late in pairwise(batches))


def test_both_shocks_of_a_quick_tap_are_felt_while_clocks_are_compared():
    """The WALT keeps one shock until it is asked, and a full comparison takes longer than a tap."""
    wire = SteppedWire(drift=9e-6)
    wire.firmware.faults.delay_s = 0.5e-3
    source = on_wire(wire, "walt")
    source.open()
    true_s = []

    def tap(firmware, at_s):
        for k in range(2):
            true_s.append(at_s + 0.003 + 0.06 * k)
            wire.at(true_s[-1], lambda firmware, t: firmware.shock(t))

    for _ in range(3):
        read_until(source, wire, wire.t_s + 1.0)
        tap(wire.firmware, wire.t_s)
        asked = source.synchronise()
        batches = read_until(source, wire, wire.t_s + 1.0)
        assert asked.is_set()
        assert taps_of(batches) == pytest.approx(true_s[-2:], abs=1e-3)
        assert rejected_of(batches) == []


def test_the_clock_is_compared_in_full_again_when_all_is_quiet():
    wire = SteppedWire()
    source = on_wire(wire, "walt")
    source.open()
    batches = read_until(source, wire, wire.t_s + 40)
    sizes = [len(b.clock.device_s) for b in batches if b.clock is not None]
    assert sizes[0] == 8  # Z and seven repeats, before anything else
    assert sum(size == 8 for size in sizes[1:]) >= 3
    assert all(isinstance(b.clock, ClockBounds) and b.clock.stream == "walt" for b in batches if b.clock)


def test_a_clock_that_jumps_begins_a_new_epoch():
    wire = SteppedWire()
    source = on_wire(wire)
    source.open()
    start_s = wire.t_s
    wire.at(start_s + 5, lambda firmware, t: firmware.jump_clock(t, 100.0))
    wire.at(start_s + 15, lambda firmware, t: firmware.edge(t, 1))
    batches = read_until(source, wire, start_s + 20)
    laser = edges_of(batches)
    assert laser.epoch.tolist() == [1]
    assert laser.t_s == pytest.approx([start_s + 15], abs=2e-4)
    assert any("clock jumped" in text for text in notices_of(batches))


@pytest.mark.parametrize("how", ["unplugged", "hangs"])
def test_it_is_lost_reported_looked_for_and_comes_back_by_itself(how):
    wire = SteppedWire()
    source = on_wire(wire)
    source.open()
    start_s = wire.t_s

    def lose(firmware, t):
        if how == "unplugged":
            wire.gone = PortGone("hung up")
        firmware.faults.mute = True

    def give_back(firmware, t):
        wire.gone = None
        firmware.faults.mute = False

    wire.at(start_s + 2.05, lambda firmware, t: firmware.edge(t, 0))
    wire.at(start_s + 3.05, lose)
    wire.at(start_s + 9.05, give_back)
    wire.at(start_s + 15.05, lambda firmware, t: firmware.edge(t, 1))
    batches = read_until(source, wire, start_s + 18)
    alive = [b.alive for b in batches]
    assert alive[0]
    assert not all(alive)
    assert alive[-1]
    laser = edges_of(batches)
    assert laser.epoch.tolist() == [0, 1]
    gap = laser.gaps_s
    assert gap[0, 0] <= start_s + 3.1
    assert gap[-1, 1] >= start_s + 9
    assert gap[1:, 0] == pytest.approx(gap[:-1, 1])  # without holes
    text = " ".join(notices_of(batches))
    assert "is gone" in text
    assert "is back" in text
    source.close()
    source.close()


def refused(wire, role="walt", address="serial:/dev/ttyACM0"):
    with pytest.raises(DeviceError) as caught:
        on_wire(wire, role, address).open()
    assert caught.value.remedy
    assert wire.closed == 1
    return str(caught.value)


def test_what_is_no_walt_or_another_firmware_is_refused():
    assert on_wire(SteppedWire(version="6\r"), "walt").open().details["firmware"] == "6"
    assert "firmware 5" in refused(SteppedWire(version="5"))
    assert "firmware 7" in refused(SteppedWire(version="7"))
    assert on_wire(SteppedWire(version="7"), "walt", "serial:/dev/x?firmware=any").open().details["firmware"] == "7"
    silent = SteppedWire()
    silent.firmware.faults.mute = True
    assert "nothing answers" in refused(silent)
    slow = SteppedWire()
    slow.firmware.faults.delay_s = 0.2
    assert "takes 0.4 s to answer" in refused(slow)
    other = SteppedWire()
    other.firmware.receive = lambda data, host_s: other.firmware.noise(host_s, b"OK\r\n")
    assert "not a WALT" in refused(other)


def test_an_answer_that_comes_too_late_is_not_taken_for_the_next():
    script = Script((b"T", b""), (b"P", b"t 5\np\n"), (b"T", b"t 900\n"))
    link = Link(script, script.now, script.pause)
    with pytest.raises(NoAnswer):
        link.ask("T", protocol.parse_time)
    assert link.ask("T", protocol.parse_time).value == 900


@pytest.mark.parametrize(
    ("at_s", "late", "delay_s", "read_s"),
    [
        # A hub that is held up: the answer with the second shock takes longer than the driver waits.
        ((1.0, 2.0, 3.0), 1, 0.25, 5),
        # Even the ping that follows the question is not answered within its second.
        ((1.0, 4.0), 0, 0.8, 6),
    ],
    ids=["late", "very late"],
)
def test_a_shock_that_is_reported_late_is_not_lost(at_s, late, delay_s, read_s):
    wire = SteppedWire()
    source = on_wire(wire, "walt")
    source.open()
    start_s = wire.t_s
    true_s = start_s + np.array(at_s)
    for shock_s in true_s:
        wire.at(shock_s, lambda firmware, t: firmware.shock(t))
    wire.at(true_s[late] - 1e-3, lambda firmware, t: setattr(firmware.faults, "delay_s", delay_s))
    wire.at(true_s[late] + 0.1, lambda firmware, t: setattr(firmware.faults, "delay_s", 0.0))
    batches = read_until(source, wire, start_s + read_s)
    assert taps_of(batches) == pytest.approx(true_s, abs=2e-4)
    assert rejected_of(batches) == []


class HeldUp(SteppedWire):
    """A wire on which the next byte after ``from_s`` takes ``held_s`` to the device."""

    from_s, held_s = np.inf, 0.0

    def write(self, data):
        if self.t_s >= self.from_s:
            self._advance(self.t_s + self.held_s)
            self.from_s = np.inf
        super().write(data)


def test_a_shock_felt_while_a_question_is_on_its_way_is_paired_with_its_touch():
    """The answer to a question that a busy computer held up for longer than the pairing looks ahead."""
    wire = HeldUp()
    source, pairer = on_wire(wire, "walt"), TapPairer()
    source.open()
    wire.from_s, wire.held_s = wire.t_s + 1.5, AHEAD_S + 0.2
    shock_s = wire.from_s + AHEAD_S + 0.15
    wire.at(shock_s, lambda firmware, t: firmware.shock(t))
    for batch in read_until(source, wire, wire.t_s + 4.0):
        pairer.add(batch.taps, None, batch.until_s)
    pairer.add(None, ContactChanges(np.array([shock_s + 0.05]), np.zeros(1), np.ones(1)), wire.t_s)
    taps = pairer.take(np.inf)
    assert taps.physical_s == pytest.approx([shock_s], abs=2e-3)
    assert taps.rejected == {}


def test_a_shock_that_was_read_is_not_lost_with_the_device():
    wire = SteppedWire()
    source = on_wire(wire, "walt")
    source.open()
    source.synchronise()  # the shock is asked for within the comparison, in which the device goes

    def unplug(firmware, t):
        wire.gone = PortGone("hung up")

    shock_s = wire.t_s + 0.01
    wire.at(shock_s, lambda firmware, t: firmware.shock(t))
    wire.at(shock_s + 0.03, unplug)
    batch = source.read(0.1)
    assert not batch.alive
    assert taps_of([batch]) == pytest.approx([shock_s], abs=1e-3)


@pytest.mark.parametrize(
    ("fault", "problem", "remedy"),
    [
        (serial.SerialException(errno.EACCES, "Permission denied"), "no rights", "dialout"),
        (serial.SerialException(errno.EBUSY, "Device or resource busy"), "another program", "close it"),
        (serial.SerialException("Could not exclusively lock port"), "another program", "close it"),
        (serial.SerialException(errno.EIO, "whatever"), "cannot be opened", "serial port"),
        (serial.SerialException(errno.ENXIO, "No such device"), "no device behind", "plug"),
    ],
)
def test_ports_that_cannot_be_opened_say_why(monkeypatch, tmp_path, fault, problem, remedy):
    def refuse(*args, **kwargs):
        raise fault

    path = tmp_path / "ttyACM0"
    path.touch()
    monkeypatch.setattr(port.serial, "Serial", refuse)
    with pytest.raises(DeviceError) as caught:
        port.SerialPort(str(path))
    assert problem in caught.value.problem
    assert remedy in caught.value.remedy


def test_a_port_that_is_not_there_names_those_that_are(monkeypatch):
    class Info:
        device, vid, product = "/dev/ttyACM7", 0x16C0, "WALT"

    monkeypatch.setattr(port.list_ports, "comports", lambda: [Info])
    with pytest.raises(DeviceError, match=r"no such port.*ttyACM7"):
        port.SerialPort("/dev/ttyACM0")


def test_a_walt_that_comes_back_under_another_number_is_found_by_its_serial_number(monkeypatch, tmp_path):
    class Info:
        def __init__(self, name, number):
            self.device, self.vid, self.pid, self.serial_number = str(tmp_path / name), 0x16C0, 0x0483, number

    old = tmp_path / "ttyACM0"
    old.touch()
    monkeypatch.setattr(port.list_ports, "comports", lambda: [Info("ttyACM0", "77"), Info("ttyACM3", "88")])
    identity = port.usb_identity(str(old))
    assert port.port_of(identity, str(old)) == str(old)
    old.unlink()
    monkeypatch.setattr(port.list_ports, "comports", lambda: [Info("ttyACM3", "88"), Info("ttyACM1", "77")])
    assert port.port_of(identity, str(old)) == str(tmp_path / "ttyACM1")
    assert port.port_of(None, str(old)) == str(old)


def test_discovery_lists_ports_of_its_usb_vendor_with_rights(monkeypatch, tmp_path):
    class Info:
        def __init__(self, device, vid):
            self.device, self.vid, self.product = str(device), vid, None

    (tmp_path / "ttyACM0").touch()
    ports = [Info(tmp_path / "ttyACM1", 0x16C0), Info(tmp_path / "ttyACM0", 0x16C0), Info(tmp_path / "x", 0x0403)]
    monkeypatch.setattr(driver.list_ports, "comports", lambda: ports)
    good, bad = driver.discover()
    assert good.address.endswith("ttyACM0")
    assert good.usable
    assert not bad.usable
    assert "dialout" in bad.remedy


def test_the_role_in_the_address_must_agree():
    assert open_source("serial:/dev/ttyACM0?role=laser", "laser").role == "laser"
    with pytest.raises(DeviceError, match="used as walt"):
        open_source("serial:/dev/ttyACM0?role=laser", "walt")
    with pytest.raises(DeviceError, match="unknown"):
        open_source("serial:/dev/ttyACM0?rolle=laser", "laser")


@pytest.mark.parametrize("role", ["walt", "laser"])
def test_it_compares_in_full_when_it_is_asked_however_busy_it_is(role):
    wire = SteppedWire()
    source = on_wire(wire, role)
    source.open()
    start_s = wire.t_s
    for k in range(200):  # never quiet
        wire.at(start_s + 0.05 * k, lambda firmware, t, k=k: firmware.edge(t, k % 2))
        wire.at(start_s + 0.05 * k, lambda firmware, t: firmware.shock(t))
    read_until(source, wire, start_s + 4)
    done = source.synchronise()
    assert not done.is_set()
    batch = source.read(0.1)
    assert done.is_set()
    assert len(batch.clock.device_s) == 8  # a quick one and seven repeats
    later = read_until(source, wire, start_s + 10)
    assert all(len(b.clock.device_s) == 1 for b in later if b.clock is not None)
    if role == "laser":
        assert sum(b.laser.missed for b in later if b.laser is not None) == 0


def test_asking_a_walt_that_is_away_does_not_wait_for_it():
    wire = SteppedWire()
    source = on_wire(wire)
    source.open()
    wire.gone = PortGone("hung up")
    source.read(0.1)
    done = source.synchronise()
    source.read(0.1)
    assert done.is_set()
