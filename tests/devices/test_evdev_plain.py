"""Touchscreens without slots, and devices that are no touchscreens."""

import evdev
import pytest

from devices.evdev_fakes import (
    ABS,
    KEY,
    TOUCH,
    FakeDevice,
    Panel,
    X,
    Y,
    down,
    dropped,
    frame,
    plain,
    read,
    touch_source,
)
from draglag.recording import concatenate
from draglag_devices.evdev_touch import kernel
from draglag_devices.source import DeviceError


def test_a_panel_without_slots_goes_on_after_an_overflow_that_hid_where_the_touch_went():
    device = FakeDevice(
        plain(100.0, (KEY, TOUCH, 1), (ABS, 0, 1000), (ABS, 1, 500)), dropped(100.1), plain(100.2, (ABS, 0, 2010)),
        dropped(100.3), plain(100.4, (KEY, TOUCH, 1), (ABS, 0, 10)), multitouch=False, slots={0: (-1, 0, 0)},
    )  # fmt: skip
    source, _ = touch_source(device)
    source.open()
    batches = [source.read(0.1)]
    device.state = {0: (0, 2000, 600)}
    batches += [source.read(0.1), source.read(0.1)]
    device.state = {0: (-1, 2000, 600)}  # lifted while events were lost
    batches += [source.read(0.1), source.read(0.1)]
    touch = concatenate([b.touch for b in batches if b.touch is not None])
    assert touch.x_raw.tolist() == [1000, 2010, 10]
    assert touch.y_raw.tolist() == [500, 600, 600]
    assert touch.contact_id.tolist() == [0, 0, 1]
    assert [down for b in batches if b.contacts is not None for down in b.contacts.down.tolist()] == [1, 0, 1]
    assert touch.dropped == 2


def test_a_touch_on_a_panel_without_slots_that_is_down_already_is_seen():
    device = FakeDevice(plain(100.0, (ABS, 0, 1100)), multitouch=False, slots={0: (0, 1000, 500)})
    source, _ = touch_source(device)
    source.open()
    batches, touch = read(source, 1)
    assert (touch.x_raw.tolist(), touch.y_raw.tolist()) == ([1100], [500])
    assert batches[0].contacts is None


def test_events_that_are_no_touch_are_named_within_seconds_and_once():
    stick = [plain(100.0 + 0.5 * k, (ABS, 2, k), (ABS, 3, -k)) for k in range(9)]
    source, _ = touch_source(FakeDevice(*stick))
    source.open()
    notices = [(k, n) for k in range(9) for n in source.read(0.1).notices]
    assert [(k, n.level) for k, n in notices] == [(6, "error")]
    assert "Panel sends events that are no touch (ABS_Z, ABS_RX)" in notices[0][1].text


def test_a_pen_that_hovers_and_a_touch_are_no_useless_events():
    hover = [plain(100.0 + 0.5 * k, (KEY, 0x140, 1), (ABS, 0, k)) for k in range(9)]
    for reads in (hover, [down(100.0, 1, 5, 5), *(frame(100.0 + 0.5 * k, (X, k)) for k in range(9))]):
        source, _ = touch_source(FakeDevice(*reads))
        source.open()
        assert [n.text for _ in range(9) for n in source.read(0.1).notices] == []


@pytest.mark.parametrize("pressed", [(), (TOUCH,)])
def test_a_panel_without_slots_is_asked_whether_and_where_it_is_touched(monkeypatch, pressed):
    monkeypatch.setattr(evdev, "InputDevice", lambda path: Panel(axes=(0, 1), pressed=pressed))
    device = kernel.KernelTouch("/dev/input/event5")
    assert device.slots() == ({0: (0 if pressed else -1, 1000, 1001)}, 0)


@pytest.mark.parametrize(
    ("axes", "keys", "words"),
    [
        ((2, 3), (TOUCH,), "Panel is not a touchscreen: it reports ABS_Z, ABS_RX;"),
        ((0, 1), (), "Panel is not a touchscreen: it reports ABS_X, ABS_Y, and no BTN_TOUCH;"),
        ((), (), "Panel is not a touchscreen: it reports no axes, and no BTN_TOUCH;"),
        ((X, Y), (TOUCH,), "Panel speaks the old multi-touch protocol without slots;"),
    ],
)
def test_what_is_no_touchscreen_is_refused_with_the_axes_it_has(monkeypatch, axes, keys, words):
    monkeypatch.setattr(evdev, "InputDevice", lambda path: Panel(axes=axes, keys=keys))
    with pytest.raises(DeviceError) as caught:
        kernel.KernelTouch("/dev/input/event5")
    assert words in str(caught.value)
