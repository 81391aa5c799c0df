"""A touchscreen made of lists, and as much of an evdev.InputDevice as the driver uses."""

import os
from types import SimpleNamespace

from draglag.recording import AxisInfo, concatenate
from draglag.touch_events.frames import InputEvent
from draglag_devices.addresses import parse_address
from draglag_devices.evdev_touch.kernel import Description
from draglag_devices.evdev_touch.source import EvdevTouch

SYN, KEY, ABS = 0, 1, 3
TOUCH = 0x14A
SLOT, X, Y, ID = 0x2F, 0x35, 0x36, 0x39


def axes(resolution=10, fuzz=0):
    return tuple(
        AxisInfo(f"ABS_MT_POSITION_{n}", 0, size - 1, resolution, fuzz) for n, size in (("X", 5000), ("Y", 3000))
    )


class FakeDevice:
    """Gives out one list of events a read; an exception in their place is raised."""

    def __init__(self, *reads, slots=None, multitouch=True, **described):
        self.description = Description("Panel", "usb-1", "7", axes(**described), multitouch, 2 if multitouch else 1)
        self.reads = list(reads)
        self.state = slots or {0: (-1, 0, 0), 1: (-1, 0, 0)}
        self.calls = []
        self.grab_error = None

    def use_monotonic(self):
        self.calls.append("monotonic")

    def slots(self):
        return dict(self.state), 0

    def events(self, timeout_s):
        if timeout_s == 0 or not self.reads:
            return []
        first = self.reads.pop(0)
        if isinstance(first, Exception):
            raise first
        return first

    def grab(self, exclusively):
        if self.grab_error:
            raise OSError(self.grab_error, "refused")
        self.calls.append(("grab", exclusively, any(values[0] >= 0 for values in self.state.values())))

    def close(self):
        self.calls.append("close")


def frame(t_s, *events):
    return [InputEvent(t_s, ABS, code, value) for code, value in events] + [InputEvent(t_s, SYN, 0, 0)]


def down(t_s, number, x, y, slot=0):
    return frame(t_s, (SLOT, slot), (ID, number), (X, x), (Y, y))


def dropped(t_s):
    return [InputEvent(t_s, SYN, 3, 0), InputEvent(t_s, ABS, X, 4999), InputEvent(t_s, SYN, 0, 0)]


class Clock:
    def __init__(self):
        self.t_s = 100.0

    def now(self):
        return self.t_s

    def pause(self, duration_s):
        self.t_s += duration_s


def touch_source(device, options="", find_devices=list):
    clock = Clock()
    devices = [device] if isinstance(device, FakeDevice) else list(device)
    address = parse_address("evdev:/dev/input/event5" + options)
    return EvdevTouch(address, lambda path: devices.pop(0), find_devices, clock.now, clock.pause), clock


def read(source, count):
    batches = [source.read(0.1) for _ in range(count)]
    return batches, concatenate([b.touch for b in batches if b.touch is not None])


def plain(t_s, *events):
    return [InputEvent(t_s, kind, code, value) for kind, code, value in events] + [InputEvent(t_s, SYN, 0, 0)]


class Panel:
    """As much of an evdev.InputDevice as the driver uses; its events come from a pipe."""

    name, phys, uniq = "Panel", "usb-1", "7"

    def __init__(self, fd=-1, axes=(SLOT, X, Y, ID), keys=(TOUCH,), pressed=()):
        self.fd, self.axes, self.keys, self.pressed = fd, axes, keys, pressed

    def capabilities(self, absinfo):
        info = SimpleNamespace(min=0, max=4095, resolution=10, fuzz=0)
        return {ABS: [(code, info) for code in self.axes], KEY: list(self.keys)}

    def active_keys(self):
        return list(self.pressed)

    def absinfo(self, code):
        return SimpleNamespace(value=1000 + code)

    def close(self):
        if self.fd >= 0:
            os.close(self.fd)
