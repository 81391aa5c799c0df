"""An event device of the kernel."""

from __future__ import annotations

import array
import errno
import fcntl
import os
import select
import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Protocol

from draglag.errors import cause
from draglag.messages import message, phrase
from draglag.recording import AxisInfo
from draglag.system.packages import advice
from draglag.touch_events.frames import (
    ABS_MT_POSITION_X,
    ABS_MT_POSITION_Y,
    ABS_MT_SLOT,
    ABS_MT_TRACKING_ID,
    ABS_X,
    ABS_Y,
    AXIS_NAMES,
    BTN_TOUCH,
    EV_ABS,
    EV_KEY,
    InputEvent,
)
from draglag.touch_events.names import event_names
from draglag_devices.source import DeviceError

RIGHTS_REMEDY = message(
    "as administrator, install the udev rules of draglag and plug it in again, or add yourself to the group input "
    "(sudo usermod -aG input $USER) and log out and in"
)
CLOCK_MONOTONIC = 1
EVIOCSCLOCKID = 0x400445A0
EVIOCGRAB = 0x40044590
_EVENT = struct.Struct("llHHi")
_READ_EVENTS = 64


class Gone(Exception):
    """The device has disappeared."""


@dataclass(frozen=True)
class Description:
    """A touchscreen; ``slots``: contacts it distinguishes."""

    name: str
    phys: str
    uniq: str
    axes: tuple[AxisInfo, AxisInfo]
    multitouch: bool
    slots: int


class TouchDevice(Protocol):
    """An open event device."""

    description: Description

    def use_monotonic(self) -> None:
        """Stamp events on CLOCK_MONOTONIC. Raises OSError."""
        ...

    def slots(self) -> tuple[dict[int, tuple[int, int, int]], int]:
        """Slot → (tracking id or −1, x, y), and the slot that events refer to. Raises Gone.

        A panel without slots has one, 0, with id 0 while touched.
        """
        ...

    def events(self, timeout_s: float) -> list[InputEvent]:
        """Events, after at most ``timeout_s``. Raises Gone."""
        ...

    def grab(self, exclusively: bool) -> None:
        """Raises OSError."""
        ...

    def close(self) -> None: ...


class KernelTouch:
    """A touchscreen through the evdev library."""

    def __init__(self, path: str) -> None:
        """Raises DeviceError."""
        address = f"evdev:{path}"
        try:
            import evdev
        except ModuleNotFoundError as missing:
            raise DeviceError(address, *advice(missing.name or "")) from None
        try:
            self._device = evdev.InputDevice(path)
        except OSError as error:
            raise _refusal(address, error) from None
        try:
            self.description = self._describe(address)
        except DeviceError:
            self.close()
            raise
        except OSError as error:
            self.close()
            raise _refusal(address, error) from None
        self._fd: int = self._device.fd
        self._rest = b""

    def _describe(self, address: str) -> Description:
        device = self._device
        able = device.capabilities(absinfo=True)
        absolute = dict(able.get(EV_ABS, []))
        pressed = BTN_TOUCH in able.get(EV_KEY, [])
        multitouch = ABS_MT_POSITION_X in absolute and ABS_MT_SLOT in absolute
        codes = (ABS_MT_POSITION_X, ABS_MT_POSITION_Y) if multitouch else (ABS_X, ABS_Y)
        if ABS_MT_POSITION_X in absolute and not multitouch:
            raise DeviceError(
                address,
                message("{name} speaks the old multi-touch protocol without slots", name=device.name),
                "update its driver",
            )
        if not all(code in absolute for code in codes) or not (multitouch or pressed):
            raise _no_touchscreen(address, device.name, absolute, pressed)
        axes = [
            AxisInfo(AXIS_NAMES[code], info.min, info.max, info.resolution, info.fuzz)
            for code, info in ((code, absolute[code]) for code in codes)
        ]
        slots = absolute[ABS_MT_SLOT].max + 1 if multitouch else 1
        return Description(
            device.name or "touchscreen", device.phys or "", device.uniq or "", (axes[0], axes[1]), multitouch, slots
        )

    def use_monotonic(self) -> None:
        fcntl.ioctl(self._fd, EVIOCSCLOCKID, struct.pack("i", CLOCK_MONOTONIC))

    def slots(self) -> tuple[dict[int, tuple[int, int, int]], int]:
        try:
            if not self.description.multitouch:
                # The kernel numbers no contacts of such a panel: 0 is the one that is down.
                contact = 0 if BTN_TOUCH in self._device.active_keys() else -1
                x, y = (int(self._device.absinfo(code).value) for code in (ABS_X, ABS_Y))
                return {0: (contact, x, y)}, 0
            ids, xs, ys = (
                self._slot_values(code) for code in (ABS_MT_TRACKING_ID, ABS_MT_POSITION_X, ABS_MT_POSITION_Y)
            )
            current = int(self._device.absinfo(ABS_MT_SLOT).value)
        except OSError as error:
            raise Gone(os.strerror(error.errno or errno.EIO)) from None
        return {k: (ids[k], xs[k], ys[k]) for k in range(self.description.slots)}, current

    def _slot_values(self, code: int) -> list[int]:
        count = self.description.slots
        values = array.array("i", [code, *([0] * count)])
        request = (2 << 30) | (values.itemsize * len(values) << 16) | 0x450A  # EVIOCGMTSLOTS(len)
        fcntl.ioctl(self._fd, request, values, True)
        return values[1:].tolist()

    def events(self, timeout_s: float) -> list[InputEvent]:
        try:
            ready, _, _ = select.select([self._fd], [], [], max(timeout_s, 0.0))
        except (OSError, ValueError) as error:
            raise Gone(str(error)) from None
        return list(self._drain()) if ready else []

    def _drain(self) -> Iterator[InputEvent]:
        while True:
            try:
                data = os.read(self._fd, _EVENT.size * _READ_EVENTS)
            except BlockingIOError:
                return
            except OSError as error:
                raise Gone(os.strerror(error.errno or errno.EIO)) from None
            if not data:
                raise Gone(message("end of file"))
            # The kernel hands out whole events; what stands in for it on a pty or socket may cut one in two.
            data = self._rest + data
            whole = len(data) // _EVENT.size * _EVENT.size
            self._rest = data[whole:]
            for seconds, micros, kind, code, value in _EVENT.iter_unpack(data[:whole]):
                yield InputEvent(seconds + micros * 1e-6, kind, code, value)

    def grab(self, exclusively: bool) -> None:
        fcntl.ioctl(self._fd, EVIOCGRAB, int(exclusively))

    def close(self) -> None:
        try:
            self._device.close()
        except OSError:
            return  # an unplugged device cannot be closed any better


def _no_touchscreen(address: str, name: str, absolute: Iterable[int], pressed: bool) -> DeviceError:
    axes = phrase(event_names((EV_ABS, code) for code in absolute))
    if not pressed:
        axes = message("{axes}, and no BTN_TOUCH", axes=axes)
    return DeviceError(
        address,
        message("{name} is not a touchscreen: it reports {axes}", name=name, axes=axes),
        "draglag devices lists touchscreens",
    )


def _refusal(address: str, error: OSError) -> DeviceError:
    if error.errno in (errno.EACCES, errno.EPERM):
        return DeviceError(address, "you have no rights to this device", RIGHTS_REMEDY)
    if error.errno in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return DeviceError(address, "there is no such device", "plug it in; draglag devices lists what is there")
    if error.errno in (errno.ENOTTY, errno.EINVAL, errno.ENOTDIR, errno.EISDIR):
        return DeviceError(address, "this is not an event device", "use /dev/input/eventN")
    return DeviceError(address, message("cannot be opened ({why})", why=cause(error)), "unplug it and plug it in again")
