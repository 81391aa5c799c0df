"""The WALT driver over a pseudo terminal, through the real serial library."""

import time

import numpy as np
import pytest

from draglag_devices.opening import open_source
from draglag_devices.source import DeviceError
from emulators.walt.wires import WaltOnPty

pytestmark = pytest.mark.wire

PATIENCE_S = 10.0


@pytest.fixture
def pen(tmp_path):
    with WaltOnPty(tmp_path, drift=15e-6) as emulated:
        yield emulated


def read_while(source, wanted):
    """Batches until ``wanted(batches)``; fails after the patience of a test."""
    batches = []
    deadline = time.monotonic() + PATIENCE_S
    while not wanted(batches):
        assert time.monotonic() < deadline, batches
        batches.append(source.read(0.05))
    return batches


def n_shocks(batches):
    return sum(len(b.taps.physical_s) for b in batches if b.taps is not None)


def n_edges(batches):
    return sum(len(b.laser.t_s) for b in batches if b.laser is not None)


def test_shocks_come_at_their_time_to_the_width_of_the_bounds(pen):
    source = open_source(f"serial:{pen.path}", "walt")
    source.open()
    try:
        true_s = time.monotonic() + np.array([0.1, 0.25, 0.4])
        pen.shocks(true_s)
        batches = read_while(source, lambda got: n_shocks(got) == 3)
        seen_s = np.concatenate([b.taps.physical_s for b in batches if b.taps is not None])
        width_s = min(float(np.min(b.clock.host_max_s - b.clock.host_min_s)) for b in batches if b.clock is not None)
        # Mapped by a line through the middles of bounds: within some widths of a bound, on a busy computer too.
        assert np.abs(seen_s - true_s).max() < max(10 * width_s, 2e-3)
    finally:
        source.close()


def test_edges_of_its_laser_lose_none_and_unplugging_is_survived(pen):
    source = open_source(f"serial:{pen.path}?role=laser", "laser")
    source.open()
    try:
        true_s = time.monotonic() + 0.05 + 0.01 * np.arange(40)
        pen.edges(true_s, np.arange(40) % 2)
        batches = read_while(source, lambda got: n_edges(got) == 40)
        light = np.concatenate([b.laser.light for b in batches if b.laser is not None])
        assert light.tolist() == [k % 2 for k in range(40)]
        assert sum(b.laser.missed for b in batches if b.laser is not None) == 0

        pen.unplug()
        lost = read_while(source, lambda got: got and not got[-1].alive)
        assert any("is gone" in n.text for n in lost[-1].notices)
        pen.plug()
        back = read_while(source, lambda got: got and got[-1].alive)
        assert len(back[-1].laser.gaps_s) == 1
        pen.edges([time.monotonic() + 0.02], [1])
        after = read_while(source, lambda got: n_edges(got) == 1)
        assert next(b.laser.epoch for b in after if b.laser is not None).tolist() == [1]
    finally:
        source.close()


def test_a_port_in_use_or_gone_is_reported(pen):
    first = open_source(f"serial:{pen.path}", "walt")
    first.open()
    try:
        with pytest.raises(DeviceError, match="another program uses this port"):
            open_source(f"serial:{pen.path}", "laser").open()
    finally:
        first.close()
    pen.unplug()
    with pytest.raises(DeviceError, match="no such port"):
        open_source(f"serial:{pen.path}", "walt").open()
