"""The touchscreen driver against a device made of lists."""

import errno
import os
import re
import struct
import sys

import evdev
import numpy as np
import pytest

from devices.evdev_fakes import (
    ABS,
    ID,
    SYN,
    FakeDevice,
    Panel,
    X,
    Y,
    axes,
    down,
    dropped,
    frame,
    read,
    touch_source,
)
from draglag.recording import concatenate
from draglag.touch_events.frames import InputEvent, Mapping2D
from draglag_devices import evdev_touch
from draglag_devices.evdev_touch import finding, kernel
from draglag_devices.evdev_touch.finding import EventDevice
from draglag_devices.evdev_touch.kernel import Gone
from draglag_devices.source import DeviceError


def test_frames_become_touch_events_in_mm_with_kernel_stamps():
    device = FakeDevice(down(100.0, 3, 1000, 500), frame(100.008, (X, 1010)), frame(100.016, (ID, -1)))
    source, _ = touch_source(device)
    info = source.open()
    assert device.calls == ["monotonic"]
    assert info.axes == axes()
    batches, touch = read(source, 3)
    assert touch.t_s.tolist() == [100.0, 100.008]
    assert touch.x_mm == pytest.approx([100.0, 101.0])
    assert touch.y_mm == pytest.approx([50.0, 50.0])
    assert touch.x_raw.tolist() == [1000, 1010]
    assert touch.contact_id.tolist() == [3, 3]
    changes = [b.contacts for b in batches if b.contacts is not None]
    assert [(c.t_s.tolist(), c.down.tolist()) for c in changes] == [([100.0], [1]), ([100.016], [0])]
    source.close()
    source.close()
    assert device.calls.count("close") == 1


def test_the_panel_size_wins_over_resolution_and_a_large_difference_is_reported():
    source, _ = touch_source(FakeDevice(down(100.0, 1, 2500, 1500)), "?width_mm=400&height_mm=300")
    source.open()
    batches, touch = read(source, 1)
    assert touch.x_mm == pytest.approx([200.0])
    reported = [n.text for n in batches[0].notices]
    assert len(reported) == 1
    assert "500.0 mm long by its resolution and 400.0 mm" in reported[0]


def test_no_size_at_all_is_refused_and_a_panel_given_by_the_program_helps():
    source, _ = touch_source(FakeDevice(resolution=0))
    with pytest.raises(DeviceError, match="width_mm"):
        source.open()
    source, _ = touch_source(FakeDevice(down(100.0, 1, 2500, 1500), resolution=0))
    source.use_panel(500.0, 300.0)
    source.open()
    assert read(source, 1)[1].x_mm == pytest.approx([250.0])


def test_a_calibration_given_by_the_program_maps_and_must_belong_to_the_panel():
    turned = Mapping2D(0.0, 0.1, 3.0, -0.1, 0.0, 400.0)
    source, _ = touch_source(FakeDevice(down(100.0, 1, 2500, 1500)), "?width_mm=400&height_mm=300")
    source.use_calibration(turned, "Panel", 0.2)
    assert "calibration, rms 0.20 mm" in str(source.open().details["mapping"])
    trace = read(source, 1)[1]
    assert (trace.x_mm, trace.y_mm) == (pytest.approx([153.0]), pytest.approx([150.0]))
    assert (trace.x_raw, trace.y_raw) == (pytest.approx([2500]), pytest.approx([1500]))
    source, _ = touch_source(FakeDevice())
    source.use_calibration(turned, "Another panel", 0.2)
    with pytest.raises(DeviceError, match="belongs to Another panel, not to Panel"):
        source.open()


def test_fuzz_is_stored_and_reported():
    source, _ = touch_source(FakeDevice(fuzz=8))
    info = source.open()
    assert info.axes[0].fuzz == 8
    assert sum("fuzz of 8" in n.text for n in source.read(0.1).notices) == 2


def test_an_overflow_is_counted_resynced_and_marked_from_the_frame_before():
    device = FakeDevice(down(100.0, 3, 1000, 500), dropped(100.1), frame(100.2, (Y, 600)))
    source, _ = touch_source(device)
    source.open()
    batches = [source.read(0.1)]
    # Meanwhile the finger was lifted and another put down: only the kernel knows.
    device.state = {0: (4, 2000, 550), 1: (-1, 0, 0)}
    batches += [source.read(0.1), source.read(0.1)]
    touch = concatenate([b.touch for b in batches if b.touch is not None])
    assert touch.contact_id.tolist() == [3, 4]
    assert touch.x_raw.tolist() == [1000, 2000]
    assert touch.y_raw.tolist() == [500, 600]
    assert touch.dropped == 1
    assert touch.gaps_s.tolist() == [[100.0, 100.2]]
    assert any("overflowed" in n.text for b in batches for n in b.notices)
    assert batches[2].contacts.down.tolist() == [0, 1]


def test_a_finger_that_is_down_already_does_not_begin_now():
    device = FakeDevice(frame(100.0, (X, 1100)), frame(100.1, (ID, -1)), slots={0: (9, 1000, 500), 1: (-1, 0, 0)})
    source, _ = touch_source(device)
    source.open()
    batches, touch = read(source, 2)
    assert touch.x_raw.tolist() == [1100]
    assert batches[0].contacts is None
    assert batches[1].contacts.down.tolist() == [0]


def test_an_unplugged_panel_is_reported_looked_for_by_name_and_place_and_comes_back():
    first = FakeDevice(down(100.0, 3, 1000, 500), Gone("No such device"))
    second = FakeDevice(down(103.0, 3, 1200, 500))
    seen: list[EventDevice] = [EventDevice("/dev/input/event2", "Another panel", "usb-9", "", True)]
    source, clock = touch_source([first, second], find_devices=lambda: seen)
    source.open()
    batches = [source.read(0.1) for _ in range(20)]
    assert "close" in first.calls
    assert not batches[-1].alive
    seen.append(EventDevice("/dev/input/event8", "Panel", "usb-1", "7", True))
    while not batches[-1].alive:
        batches.append(source.read(0.1))
        assert clock.t_s < 200
    batches.append(source.read(0.1))
    touch = concatenate([b.touch for b in batches if b.touch is not None])
    assert len(touch.t_s) == 2
    # The kernel counts contacts from the start again; they are not the same contact.
    assert touch.contact_id[0] != touch.contact_id[1]
    assert touch.gaps_s[0, 0] == pytest.approx(100.0, abs=0.1)
    assert touch.gaps_s[1:, 0] == pytest.approx(touch.gaps_s[:-1, 1])
    notices = [n for b in batches for n in b.notices]
    assert [(n.level, n.state) for n in notices] == [("error", "lost"), ("info", "back")]
    text = " ".join(n.text for n in notices)
    assert "Panel is gone (No such device)" in text
    assert "back at /dev/input/event8" in text


def test_exclusive_use_begins_and_ends_only_while_nothing_is_down():
    device = FakeDevice([], [], slots={0: (1, 5, 5), 1: (-1, 0, 0)})
    source, _ = touch_source(device, "?exclusive=1")
    source.open()
    source.read(0.1)
    assert ("grab", True, True) not in device.calls
    device.state = {0: (-1, 5, 5), 1: (-1, 0, 0)}
    source.read(0.1)
    assert ("grab", True, False) in device.calls
    source.close()
    assert device.calls[-2:] == [("grab", False, False), "close"]


def test_a_finger_that_comes_between_the_look_and_the_taking_is_let_go_of():
    class TouchedThen(FakeDevice):
        def grab(self, exclusively):
            if len(self.calls) == 1:  # after its clock was set: the first of all
                self.state = {0: (1, 5, 5), 1: (-1, 0, 0)}
            super().grab(exclusively)

    device = TouchedThen([], [])
    source, _ = touch_source(device, "?exclusive=1")
    source.open()
    source.read(0.1)
    assert device.calls[1:] == [("grab", True, True), ("grab", False, True)]
    device.state = {0: (-1, 5, 5), 1: (-1, 0, 0)}
    source.read(0.1)
    assert device.calls[3:] == [("grab", True, False)]
    source.close()


def test_exclusive_use_that_another_program_has_is_reported_once():
    device = FakeDevice()
    device.grab_error = errno.EBUSY
    source, _ = touch_source(device, "?exclusive=1")
    source.open()
    reported = [n.text for _ in range(3) for n in source.read(0.1).notices]
    assert reported == ["The touchscreen is not used exclusively: another program holds it."]


def test_stamps_of_another_clock_are_reported_once():
    source, _ = touch_source(FakeDevice(down(1.7e9, 1, 5, 5), frame(1.7e9 + 1, (X, 6))))
    source.open()
    reported = [n.text for _ in range(2) for n in source.read(0.1).notices]
    assert len(reported) == 1
    assert "not stamped on the host's monotonic clock" in reported[0]


@pytest.mark.parametrize(
    ("code", "problem", "remedy"),
    [
        (errno.EACCES, "no rights", "udev rules"),
        (errno.ENOENT, "no such device", "plug it in"),
        (errno.ENODEV, "no such device", "plug it in"),
        (errno.ENOTTY, "not an event device", "/dev/input/eventN"),
        (errno.EIO, "cannot be opened", "unplug"),
    ],
)
def test_devices_that_cannot_be_opened_say_why(monkeypatch, code, problem, remedy):
    import evdev

    def refuse(path):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(evdev, "InputDevice", refuse)
    with pytest.raises(DeviceError) as caught:
        kernel.KernelTouch("/dev/input/event5")
    assert problem in caught.value.problem
    assert remedy in caught.value.remedy


def sysfs_device(root, number, *, name, abs_="0", properties="0", key="0"):
    folder = root / f"event{number}" / "device"
    (folder / "capabilities").mkdir(parents=True)
    for file, text in (("name", name), ("phys", ""), ("properties", properties), ("capabilities/abs", abs_),
                       ("capabilities/key", key)):  # fmt: skip
        (folder / file).write_text(text + "\n")


def test_discovery_distinguishes_touchscreens_from_touchpads_and_mice_without_rights(tmp_path, monkeypatch):
    # Bitmaps as /proc/bus/input/devices shows them on real machines.
    sysfs_device(tmp_path, 10, name="Touchscreen", abs_="261800000000003", properties="2")
    sysfs_device(tmp_path, 2, name="Touchpad", abs_="2e0800000000003", properties="5")
    sysfs_device(tmp_path, 3, name="Mouse")
    sysfs_device(tmp_path, 4, name="Multi", abs_="273800000000003", properties="2")
    sysfs_device(tmp_path, 7, name="Single", abs_="3", properties="2", key="400 0 0 0 0 0")
    seen = {device.name: device.touchscreen for device in finding.event_devices(tmp_path)}
    assert seen == {"Touchpad": False, "Mouse": False, "Multi": True, "Single": True, "Touchscreen": True}
    assert [d.path for d in finding.event_devices(tmp_path)][-1] == "/dev/input/event10"
    monkeypatch.setattr(evdev_touch, "event_devices", lambda: finding.event_devices(tmp_path))
    found = evdev_touch.discover()
    assert [f.address for f in found] == [f"evdev:/dev/input/event{n}" for n in (4, 7, 10)]
    assert not found[0].usable
    assert "udev rules" in found[0].remedy


def test_without_its_library_a_touchscreen_is_not_ready_and_says_what_to_install(tmp_path, monkeypatch):
    sysfs_device(tmp_path, 4, name="Multi", abs_="273800000000003", properties="2")
    monkeypatch.setattr(evdev_touch, "event_devices", lambda: finding.event_devices(tmp_path))
    monkeypatch.setitem(sys.modules, "evdev", None)
    (found,) = evdev_touch.discover()
    assert not found.usable
    assert re.search(r"package evdev(-binary)? \(extra devices\) is not installed", found.description)
    assert found.remedy == 'run: pip install "draglag[devices]"'
    with pytest.raises(DeviceError, match=r"event4: the Python package evdev.*run: pip install \"draglag\[devices\]\""):
        kernel.KernelTouch("/dev/input/event4")


def test_a_calibration_is_used_and_must_belong_to_the_panel(tmp_path):
    from draglag.instruments.calibration import fit_affine
    from draglag_devices.calibration import save_calibration

    x = np.array([500.0, 4500, 500, 4500, 2500])
    y = np.array([300.0, 300, 2700, 2700, 1500])
    fit = fit_affine(x, y, 0.1 * y, 500 - 0.1 * x)  # turned by a quarter
    save_calibration(fit, tmp_path / "cal.json", "Panel")
    source, _ = touch_source(FakeDevice(down(100.0, 1, 1000, 2000)), f"?calibration={tmp_path / 'cal.json'}")
    source.open()
    touch = read(source, 1)[1]
    assert (touch.x_mm[0], touch.y_mm[0]) == pytest.approx((200.0, 400.0))
    save_calibration(fit, tmp_path / "other.json", "Other panel")
    source, _ = touch_source(FakeDevice(), f"?calibration={tmp_path / 'other.json'}")
    with pytest.raises(DeviceError, match="belongs to Other panel"):
        source.open()
    source, _ = touch_source(FakeDevice(), f"?calibration={tmp_path / 'none.json'}")
    with pytest.raises(DeviceError, match="cannot be read"):
        source.open()


def test_what_the_buffer_still_held_after_an_overflow_is_not_taken_for_the_new_contact():
    """As the kernel has it: the marker, then the newest events that fitted, all older than the slots' answer."""
    stale = [*frame(99.5, (X, 900)), *frame(99.6, (X, 910)), *frame(99.7, (ID, -1)), *down(99.8, 8, 50, 60)]
    device = FakeDevice(
        down(99.0, 7, 100, 100), dropped(99.2) + stale, frame(100.5, (X, 60)), slots={0: (8, 50, 60), 1: (-1, 0, 0)}
    )
    device.state = {0: (-1, 0, 0), 1: (-1, 0, 0)}
    source, _ = touch_source(device)
    source.open()
    first = source.read(0.1)
    device.state = {0: (8, 50, 60), 1: (-1, 0, 0)}
    batches, touch = read(source, 2)
    assert touch.contact_id.tolist() == [8]
    assert touch.x_mm == pytest.approx([6.0])
    assert touch.dropped >= 1
    assert touch.gaps_s[0] == pytest.approx([99.0, 100.5])
    changes = [b.contacts for b in (first, *batches) if b.contacts is not None]
    reported = [(i, d) for c in changes for i, d in zip(c.contact_id.tolist(), c.down.tolist(), strict=True)]
    assert reported == [(7, 1), (7, 0), (8, 1)]


def test_an_event_cut_in_two_by_a_read_is_whole_again(monkeypatch):
    inlet, outlet = os.pipe()
    os.set_blocking(inlet, False)
    monkeypatch.setattr(evdev, "InputDevice", lambda path: Panel(inlet))
    device = kernel.KernelTouch("/dev/input/event5")
    reported = [(3, 250_000, ABS, X, 17), (3, 250_000, ABS, Y, -4), (3, 250_000, SYN, 0, 0)]
    data = b"".join(struct.pack("llHHi", *event) for event in reported)
    read = []
    for piece in (data[:40], data[40:41], data[41:]):
        os.write(outlet, piece)
        read += device.events(0.0)
    device.close()
    os.close(outlet)
    assert read == [InputEvent(3.25, *event[2:]) for event in reported]
