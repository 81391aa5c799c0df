"""WALTs that keep to the protocol in another way than ours: chunks, line ends, delays, what J forgets."""

import numpy as np
import pytest

from draglag.instruments.clocks import fit_clocks
from draglag.recording import LaserTrace, concatenate
from draglag_devices.addresses import parse_address
from draglag_devices.walt.source import WaltSource
from emulators.walt.firmware import Firmware
from emulators.walt.wires import SteppedWire


class Forgets(Firmware):
    """J (and E) also set the count of the detector back."""

    def _obey(self, command, at_s):
        free_s = super()._obey(command, at_s)
        if command == "J":
            self._laser.count = 0
        if command == "E":
            self._screen.count = 0
        return free_s


class Windows(Firmware):
    """Lines end in CR LF."""

    def _emit(self, at_s, data):
        super()._emit(at_s, data.replace(b"\n", b"\r\n"))


class Chunks(Firmware):
    """Every byte comes by itself, a USB frame after the other."""

    def _emit(self, at_s, data):
        for k in range(len(data)):
            super()._emit(at_s + 125e-6 * k, data[k : k + 1])


class Hub(Firmware):
    """Every line takes 5 to 50 ms to the host."""

    def _line(self, at_s, text):
        self.faults.delay_s, held = float(self._rng.uniform(5e-3, 50e-3)), self.faults.delay_s
        try:
            super()._line(at_s, text)
        finally:
            self.faults.delay_s = held


class Banner(Firmware):
    """Half a line is on the wire already, its first answer is spoiled, and it greets in the middle."""

    def __init__(self, host_s, **options):
        super().__init__(host_s, **options)
        self.noise(host_s, b"\x00\x81G L 12")
        self.noise(host_s + 0.03, b"WALT ready\r\n \xff\x00")


class Chatty(Firmware):
    """The screen's photodiode sends too, for it was switched on by somebody else in the middle."""

    def turn(self, until_s):
        self._screen.autosend = True
        super().turn(until_s)


# Ways of unknown length leave the clock open: to the shortest seen there and back, or the length of a line.
OPEN_S = {Hub: 15e-3, Chunks: 2e-3}
KINDS = [Firmware, Forgets, Windows, Chunks, Hub, Chatty, Banner]


def source_on(wire, role):
    return WaltSource(parse_address("serial:/dev/ttyACM0"), role, lambda path: wire, wire.now, wire.pause)


def batches_until(source, wire, to_s):
    found = []
    while wire.t_s < to_s:
        found.append(source.read(0.1))
    return found


@pytest.mark.parametrize("drift", [-80e-6, 60e-6])
@pytest.mark.parametrize("kind", KINDS)
def test_edges_land_within_the_bounds_and_none_is_lost_or_invented(kind, drift):
    wire = SteppedWire(kind, drift=drift, seed=8)
    # The beam is crossed while it opens, too.
    for k in range(3):
        wire.at(wire.t_s + 0.013 * (k + 1), lambda firmware, t, k=k: firmware.edge(t, k % 2))
    source = source_on(wire, "laser")
    source.open()
    start_s = wire.t_s
    true_s = start_s + 0.5 + np.cumsum(np.random.default_rng(3).uniform(0.1, 0.9, 60))
    for k, at_s in enumerate(true_s):
        wire.at(at_s, lambda firmware, t, k=k: firmware.edge(t, (k + 1) % 2))
        wire.at(at_s + 0.05, lambda firmware, t, k=k: firmware.screen_edge(t, k % 2))
    batches = batches_until(source, wire, true_s[-1] + 1)
    laser: LaserTrace = concatenate([b.laser for b in batches if b.laser is not None])
    assert all(batch.alive for batch in batches)
    assert laser.missed == 0
    assert laser.light.tolist() == [(k + 1) % 2 for k in range(60)]
    fit = fit_clocks([concatenate([b.clock for b in batches if b.clock is not None])])["laser"]
    assert list(fit.epochs) == [0]
    assert fit.epochs[0].slack_s == 0
    host_s, width_s = fit.map_to_host(laser.device_t_s, laser.epoch)
    assert (np.abs(host_s - true_s) <= width_s + 1e-6).all()
    assert width_s.max() < OPEN_S.get(kind, 1e-3)


@pytest.mark.parametrize("kind", KINDS)
def test_shocks_come_once_each_also_while_clocks_are_compared(kind):
    wire = SteppedWire(kind, drift=20e-6, seed=2)
    source = source_on(wire, "walt")
    source.open()
    start_s = wire.t_s
    true_s = start_s + np.array([1.0, 6.0, 14.0, 20.0, 33.3])
    for at_s in true_s:
        wire.at(at_s, lambda firmware, t: firmware.shock(t))
    asked = []
    # One comparison is under way when the second shock comes.
    wire.at(true_s[1] - 0.01, lambda firmware, t: asked.append(source.synchronise()))
    batches = batches_until(source, wire, start_s + 36)
    taps = np.concatenate([b.taps.physical_s for b in batches if b.taps is not None])
    assert taps == pytest.approx(true_s, abs=OPEN_S.get(kind, 5e-4))
    assert asked[0].is_set()


def test_a_count_above_one_after_opening_is_a_loss_whatever_j_does():
    for kind in (Firmware, Forgets):
        wire = SteppedWire(kind)
        for k in range(2):
            wire.at(wire.t_s + 0.02 * (k + 1), lambda firmware, t, k=k: firmware.edge(t, k % 2))
        source = source_on(wire, "laser")
        source.open()
        start_s = wire.t_s
        for k, after_s in enumerate((0.5, 0.500004, 0.500008)):
            wire.at(start_s + after_s, lambda firmware, t, k=k: firmware.edge(t, k % 2))
        laser = concatenate([b.laser for b in batches_until(source, wire, start_s + 1) if b.laser is not None])
        assert len(laser.t_s) + laser.missed == 3, kind
