"""Panels without slots: contacts are listed frame by frame."""

import pytest

from draglag.exchange.importers.evemu import parse_evemu
from draglag_devices.addresses import parse_address
from draglag_devices.replay import load_tape
from draglag_devices.source import DeviceError

AXES = "N: old panel\nA: 35 0 4000 0 0 40\nA: 36 0 2000 0 0 40\n"
X, Y, ID = "0035", "0036", "0039"


def recording(*frames, numbered=False, keys=False):
    """An evemu text: each frame a list of (x, y) or (x, y, number)."""
    lines = []
    for k, places in enumerate(frames):
        at = f"E: {1 + 0.01 * k:.6f}"
        if keys:
            lines.append(f"{at} 0001 014a {int(bool(places))}")
        for x, y, *number in places:
            lines += [f"{at} 0003 {ID} {number[0]}"] if numbered else []
            lines += [f"{at} 0003 {X} {x}", f"{at} 0003 {Y} {y}", f"{at} 0000 0002 0"]
        if not places and not keys:
            lines.append(f"{at} 0000 0002 0")
        lines.append(f"{at} 0000 0000 0")
    return AXES + "\n".join(lines) + "\n"


def contacts(text):
    return [{c.contact_id: (c.x, c.y) for c in frame.contacts} for frame in parse_evemu(text).frames()]


@pytest.mark.parametrize("keys", [False, True])
def test_a_drag_is_one_contact_and_the_next_touch_another(keys):
    text = recording([(100, 50)], [(110, 50)], [], [(110, 60)], keys=keys)
    assert contacts(text) == [{0: (100, 50)}, {0: (110, 50)}, {}, {1: (110, 60)}]
    assert [frame.lifted for frame in parse_evemu(text).frames()] == [(), (), (0,), ()]


def test_contacts_are_followed_by_place_in_whatever_order_they_are_listed():
    text = recording([(100, 50)], [(3000, 900), (110, 50)], [(120, 50), (2990, 900)], [(2980, 900)])
    assert contacts(text) == [
        {0: (100, 50)},
        {0: (110, 50), 1: (3000, 900)},
        {0: (120, 50), 1: (2990, 900)},
        {1: (2980, 900)},
    ]


def test_numbers_of_the_panel_count_more_than_places_and_begin_again_with_each_touch():
    text = recording([(100, 50, 4), (200, 50, 7)], [(190, 50, 4), (110, 50, 7)], [], [(5, 5, 4)], numbered=True)
    assert contacts(text) == [{0: (100, 50), 1: (200, 50)}, {0: (190, 50), 1: (110, 50)}, {}, {2: (5, 5)}]


def test_lost_events_are_marked_and_what_is_left_of_their_frame_is_no_position():
    text = recording([(100, 50)], [(110, 50)]) + (
        f"E: 1.02 0003 {X} 999\nE: 1.02 0000 0003 0\nE: 1.03 0003 {Y} 999\nE: 1.03 0000 0000 0\n"
        f"E: 1.04 0003 {X} 120\nE: 1.04 0003 {Y} 50\nE: 1.04 0000 0002 0\nE: 1.04 0000 0000 0\n"
    )
    frames = parse_evemu(text).frames()
    assert [frame.dropped for frame in frames] == [False, False, True]
    assert contacts(text)[-1] == {0: (120, 50)}


def test_a_recording_without_slots_is_replayed_in_mm(tmp_path):
    path = tmp_path / "old.events"
    path.write_text(recording([(400, 80)], [(440, 80)], [(480, 120)], []))
    (run,) = load_tape(parse_address(f"replay:{path}"), "touch").runs
    assert run.touch.x_mm.tolist() == [10, 11, 12]
    assert run.touch.y_mm.tolist() == [2, 2, 3]
    assert set(run.touch.contact_id.tolist()) == {0}


def test_a_recording_without_any_touch_is_refused_with_what_it_has(tmp_path):
    path = tmp_path / "stick.events"
    path.write_text("A: 00 0 100 0 0 1\nA: 01 0 100 0 0 1\nE: 1 0003 0000 5\nE: 1 0003 0003 5\nE: 1 0000 0000 0\n")
    with pytest.raises(DeviceError) as caught:
        load_tape(parse_address(f"replay:{path}"), "touch")
    assert "the recording holds no touch: it has ABS_X, ABS_RX; record a touchscreen" in str(caught.value)
