"""The decoder of kernel events, on small recordings with a known truth and on real ones where they are at hand."""

from pathlib import Path

import numpy as np
import pytest

from draglag.errors import DataError
from draglag.exchange.importers.evemu import parse_evemu, read_evemu
from draglag.recording import AxisInfo
from draglag.touch_events.frames import (
    ContactFollower,
    FrameDecoder,
    InputEvent,
    Mapping2D,
    decode,
    panel_mapping,
    touch_trace,
)

UNITS = Mapping2D(1, 0, 0, 0, 1, 0)

TWO_SLOTS = """
N: test panel
A: 35 0 4000 0 0 40
A: 36 0 2000 4 0 40
E: 1.000 0003 002f 0
E: 1.000 0003 0039 7
E: 1.000 0003 0035 100
E: 1.000 0003 0036 200
E: 1.000 0003 0000 90
E: 1.000 0000 0000 0
E: 1.008 0003 0035 110
E: 1.008 0003 002f 1
E: 1.008 0003 0039 8
E: 1.008 0003 0035 3000
E: 1.008 0003 0036 1000
E: 1.008 0000 0000 0
E: 1.016 0003 0036 1010
E: 1.016 0000 0000 0
E: 1.024 0003 002f 0
E: 1.024 0003 0039 -1
E: 1.024 0000 0000 0
E: 1.032 0003 002f 1
E: 1.032 0003 0039 -1
E: 1.032 0000 0000 0
"""


def frames_of(text):
    recording = parse_evemu(text)
    return list(decode(recording.events, recording.multitouch))


def test_slots_are_distinguished_and_hold_what_is_not_repeated():
    seen = [[(c.contact_id, c.x, c.y) for c in frame.contacts] for frame in frames_of(TWO_SLOTS)]
    assert seen == [
        [(7, 100, 200)],
        [(7, 110, 200), (8, 3000, 1000)],
        [(7, 110, 200), (8, 3000, 1010)],
        [(8, 3000, 1010)],
        [],
    ]
    assert [frame.lifted for frame in frames_of(TWO_SLOTS)] == [(), (), (), (7,), (8,)]


def test_one_contact_is_followed_until_it_lifts():
    follower = ContactFollower()
    trace = touch_trace(frames_of(TWO_SLOTS), UNITS, follower=follower)
    assert trace.contact_id.tolist() == [7, 7, 7, 8]
    assert trace.x_raw.tolist() == [100, 110, 110, 3000]
    assert trace.t_s.tolist() == [1.0, 1.008, 1.016, 1.024]
    assert follower.ignored == 2


def test_the_unfiltered_position_is_preferred_over_abs_x():
    assert touch_trace(frames_of(TWO_SLOTS), UNITS).x_raw[0] == 100


def test_a_contact_that_takes_over_a_slot_ends_the_one_before():
    text = "E: 1 3 39 4\nE: 1 3 35 5\nE: 1 3 36 6\nE: 1 0 0 0\nE: 2 3 39 5\nE: 2 0 0 0\n"
    _, second = frames_of(text)
    assert second.lifted == (4,)
    assert (second.contacts[0].contact_id, second.contacts[0].x) == (5, 5)


def test_plain_axes_are_read_where_there_are_no_slots():
    text = """
E: 1 0001 014a 1
E: 1 0003 0000 10
E: 1 0003 0001 20
E: 1 0000 0000 0
E: 2 0003 0000 11
E: 2 0000 0000 0
E: 3 0001 014a 0
E: 3 0000 0000 0
E: 4 0001 014a 1
E: 4 0000 0000 0
"""
    trace = touch_trace(frames_of(text), UNITS)
    assert trace.t_s.tolist() == [1, 2, 4]
    assert trace.x_raw.tolist() == [10, 11, 11]
    assert trace.contact_id.tolist() == [0, 0, 1]


def test_after_lost_events_all_up_to_the_next_report_is_discarded_and_the_gap_is_marked():
    text = """
E: 1.0 0003 0039 1
E: 1.0 0003 0035 10
E: 1.0 0003 0036 10
E: 1.0 0000 0000 0
E: 1.1 0003 0035 11
E: 1.1 0000 0003 0
E: 1.2 0003 0035 99
E: 1.2 0000 0000 0
E: 1.3 0003 0035 13
E: 1.3 0000 0000 0
E: 1.4 0003 0035 14
E: 1.4 0000 0000 0
"""
    trace = touch_trace(frames_of(text), UNITS)
    assert trace.t_s.tolist() == [1.0, 1.3, 1.4]
    assert 99 not in trace.x_raw
    assert trace.gaps_s.tolist() == [[1.0, 1.3]]
    assert trace.dropped == 1


def test_resync_replaces_the_slots_by_the_kernels():
    decoder = FrameDecoder()
    for event in parse_evemu("E: 1 3 39 1\nE: 1 3 35 10\nE: 1 3 36 10\nE: 1 0 0 0\n").events:
        decoder.feed(event)
    for event in (InputEvent(1.1, 0, 3, 0), InputEvent(1.2, 0, 0, 0)):
        assert decoder.feed(event) is None
    decoder.resync({0: (2, 50, 60)})
    frame = decoder.feed(InputEvent(1.3, 0, 0, 0))
    assert frame is not None
    assert frame.dropped
    assert frame.lifted == (1,)
    assert [(c.contact_id, c.x, c.y) for c in frame.contacts] == [(2, 50, 60)]


def test_the_digitisers_own_stamps_survive_a_wrap():
    stamps = [2**32 - 1000, 2**32 - 500, 200]
    lines = ["E: 0 3 39 1", "E: 0 3 35 1", "E: 0 3 36 1"]
    for k, stamp in enumerate(stamps):
        signed = stamp - 2**32 if stamp >= 2**31 else stamp
        lines += [f"E: {k} 4 5 {signed}", f"E: {k} 0 0 0"]
    trace = touch_trace(frames_of("\n".join(lines)), UNITS)
    np.testing.assert_allclose(np.diff(trace.device_t_s), [500e-6, 700e-6], atol=1e-9)


def test_the_panel_wins_over_the_axis_resolution():
    x, y = AxisInfo("x", 0, 3999, 40), AxisInfo("y", 100, 2099, 40)
    by_axis, by_panel = panel_mapping(x, y), panel_mapping(x, y, 200.0, 100.0)
    assert by_axis(np.array([40.0]), np.array([140.0])) == (1.0, 1.0)
    assert by_panel(np.array([20.0]), np.array([120.0])) == (1.0, 1.0)


def test_an_axis_without_a_size_is_refused():
    with pytest.raises(ValueError, match="no resolution"):
        panel_mapping(AxisInfo("x", 0, 100), AxisInfo("y", 0, 100))


@pytest.mark.parametrize("line", ["E: 1.0 3 35", "E: now 3 35 1", "A: 35 0"])
def test_a_malformed_line_is_named(line):
    with pytest.raises(DataError, match="line 2"):
        parse_evemu(f"E: 1 3 39 1\n{line}\n", "file")


# --- real recordings, which are not part of the project ---

REAL = Path(__file__).resolve().parents[3] / "shared" / "real-recordings"
real = pytest.mark.skipif(not REAL.is_dir(), reason=f"no real recordings at {REAL}")


def read_real(name):
    recording = read_evemu(REAL / name)
    frames = list(decode(recording.events, recording.multitouch))
    return recording, frames, touch_trace(frames, UNITS)


@real
@pytest.mark.parametrize(
    ("name", "moved", "spacing_ms"),
    [
        ("bamboo-circle.events", 375, 10.0),
        ("elan-cando-drag-up-down.events", 259, 9.0),
        ("atmel-maxtouch-drag-up-down.events", 149, 13.8),
        ("isdv4-e6-circle.events", 83, 10.0),  # 84 frames, of which the last lifts
    ],
)
def test_real_frame_counts_and_rates(name, moved, spacing_ms):
    _, frames, trace = read_real(name)
    assert sum(any(c.moved for c in frame.contacts) for frame in frames) == moved
    assert np.median(np.diff(trace.t_s)) * 1e3 == pytest.approx(spacing_ms, abs=0.05)


@real
def test_real_multi_touch_with_the_digitisers_own_stamps():
    recording, frames, trace = read_real("dell-canvas-touch.evemu")
    assert np.median(np.diff(trace.t_s)) == pytest.approx(1 / 166, rel=0.005)
    # Every contact that began has ended, and every frame has the device's stamp.
    begun = [e.value for e in recording.events if (e.type, e.code) == (3, 0x39) and e.value >= 0]
    assert sorted(i for frame in frames for i in frame.lifted) == sorted(begun)
    assert len(trace.device_t_s) == len(trace.t_s)
    assert panel_mapping(*recording.position_axes()).xx == pytest.approx(1 / 55)


@real
def test_real_gzipped_recording():
    recording, _, trace = read_real("wacom-dth2242-finger.events.gz")
    assert len(recording.events) == 16593
    assert np.median(np.diff(trace.t_s)) == pytest.approx(1 / 125, rel=0.005)
    assert [axis.fuzz for axis in recording.position_axes()] == [4, 4]
