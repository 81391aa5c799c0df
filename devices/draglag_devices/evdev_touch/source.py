"""A touchscreen as a source."""

from __future__ import annotations

import contextlib
import errno
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from draglag.errors import DataError, cause, message_of
from draglag.instruments.calibration import SIZE_TOLERANCE
from draglag.messages import message
from draglag.recording import TouchTrace, empty_touch
from draglag.touch_events.frames import (
    EV_SYN,
    SYN_DROPPED,
    SYN_REPORT,
    ContactFollower,
    Frame,
    FrameDecoder,
    InputEvent,
    Mapping2D,
    panel_mapping,
    touch_trace,
)
from draglag_devices.addresses import Address
from draglag_devices.calibration import as_mapping, load_calibration
from draglag_devices.evdev_touch.changes import ContactLog
from draglag_devices.evdev_touch.finding import EventDevice, event_devices
from draglag_devices.evdev_touch.kernel import Gone, KernelTouch, TouchDevice
from draglag_devices.evdev_touch.useless import UselessEvents
from draglag_devices.source import Batch, ContactChanges, DeviceError, Notice, SourceInfo

# Events of some frames are handed on together; the kernel's buffer holds 300 ms and more.
GATHER_S = 0.015
# The kernel stamps an event and queues it a little later.
QUEUED_S = 0.002
RETRY_S = 0.5
GAP_EVERY_S = 1.0
# Stamps further than this from the host's clock are on another one.
OTHER_CLOCK_S = 5.0
# Tracking ids restart from 0 when a device comes back; ours do not.
_IDS = 1 << 16
_UNGRAB_TIMEOUT_S = 1.0


class EvdevTouch:
    """A touchscreen; a lost one is searched for by name and port."""

    realtime = True
    role = "touch"

    def __init__(
        self,
        address: Address,
        open_device: Callable[[str], TouchDevice] = KernelTouch,
        find_devices: Callable[[], list[EventDevice]] = event_devices,
        now: Callable[[], float] = time.monotonic,
        pause: Callable[[float], None] = time.sleep,
    ) -> None:
        self.address = address.text
        self._path = address.target
        self._exclusive = address.choice("exclusive", ("0", "1"), "0") == "1"
        self._panel_mm = (address.number("width_mm"), address.number("height_mm"))
        self._calibration = address.options.get("calibration")
        self._open_device, self._find_devices, self._now, self._pause = open_device, find_devices, now, pause
        self._device: TouchDevice | None = None
        self._decoder = FrameDecoder()
        self._follower = ContactFollower()
        self._contacts = ContactLog()
        self._useless = UselessEvents()
        self._notices: list[Notice] = []
        self._mapping: Mapping2D | None = None
        self._fitted: tuple[Mapping2D, str, float] | None = None
        self._grabbed = self._syncing = self._clock_reported = False
        self._until_s = self._next_try_s = 0.0
        self._known_s = -np.inf  # after an overflow: the slots were asked for then, what happened before is in them
        self._last_frame_s: float | None = None
        self._identity = ("", "", "")
        self._returns = 0

    def use_panel(self, width_mm: float, height_mm: float) -> None:
        """As ``AcceptsPanel``; a size in the address has precedence."""
        given = self._panel_mm
        self._panel_mm = (given[0] or width_mm, given[1] or height_mm)

    def use_calibration(self, mapping: Mapping2D, device: str, rms_mm: float) -> None:
        """As ``AcceptsCalibration``; one in the address has precedence."""
        self._fitted = (mapping, device, rms_mm)

    def open(self) -> SourceInfo:
        device = self._connect(self._path)
        what = device.description
        try:
            self._mapping, how = self._mapping_for(device)
        except DeviceError:
            device.close()
            raise
        self._device = device
        self._identity = (what.name, what.phys, what.uniq)
        self._until_s = self._now()
        self._report_axes(device)
        details: dict[str, str | float | int] = {
            "name": what.name,
            "phys": what.phys,
            "slots": what.slots,
            "mapping": how,
            "fuzz_x": what.axes[0].fuzz,
            "fuzz_y": what.axes[1].fuzz,
        }
        return SourceInfo(
            self.address, self.role, what.name, message("kernel stamps, CLOCK_MONOTONIC"), details, axes=what.axes
        )

    def read(self, timeout_s: float) -> Batch:
        device = self._device
        if device is None:
            return self._while_lost(timeout_s)
        try:
            self._grab_when_free(device)
            events = device.events(timeout_s)
            if events:
                self._pause(GATHER_S)
            before_s = self._now()
            events += device.events(0.0)
            frames = self._decode(device, events)
        except Gone as fault:
            return self._lose(fault)
        trace = self._trace(frames)
        changes = self._contacts.take(frames, self._returns * _IDS)
        self._until_s = max(self._until_s, before_s - QUEUED_S)
        return self._batch(touch=trace, contacts=changes)

    def close(self) -> None:
        device, self._device = self._device, None
        if device is None:
            return
        try:
            if self._grabbed:
                self._ungrab(device)
        except (Gone, OSError):
            pass  # closing lets go of it as well
        device.close()

    # --- connection -------------------------------------------------------------------------------------------

    def _connect(self, path: str) -> TouchDevice:
        device = self._open_device(path)
        try:
            device.use_monotonic()
            device.events(0.0)  # what was queued before carries stamps of another clock
            self._decoder = FrameDecoder(device.description.multitouch)
            slots, current = device.slots()
        except OSError:
            device.close()
            raise DeviceError(
                self.address, "its events cannot be stamped on the monotonic clock", "use a kernel of 3.4 or later"
            ) from None
        except Gone as fault:
            device.close()
            raise DeviceError(
                self.address, message("it was unplugged ({why})", why=message_of(fault)), "plug it in again"
            ) from None
        # What is down already did not begin now.
        self._decoder.resync(slots, current)
        self._contacts = ContactLog({values[0] for values in slots.values() if values[0] >= 0})
        self._follower = ContactFollower()
        self._grabbed = self._syncing = False
        self._known_s = -np.inf
        self._last_frame_s = None
        return device

    def _mapping_for(self, device: TouchDevice) -> tuple[Mapping2D, str]:
        what = device.description
        if self._calibration is not None:
            try:
                fit, name = load_calibration(Path(self._calibration))
            except DataError as error:
                raise DeviceError(self.address, error.problem, error.remedy) from None
            if name and name != what.name:
                raise DeviceError(
                    self.address,
                    message("the calibration belongs to {name}, not to {other}", name=name, other=what.name),
                    "calibrate",
                )
            return as_mapping(fit), f"calibration, rms {fit.rms_mm:.2f} mm"
        if self._fitted is not None:
            mapping, name, rms_mm = self._fitted
            if name and name != what.name:
                problem = message("the calibration belongs to {name}, not to {other}", name=name, other=what.name)
                raise DeviceError(self.address, problem, "calibrate again, or forget the calibration")
            return mapping, f"calibration, rms {rms_mm:.2f} mm"
        width_mm, height_mm = self._panel_mm
        try:
            return panel_mapping(*what.axes, width_mm, height_mm), "panel size" if width_mm else "resolution"
        except ValueError as error:
            raise DeviceError(self.address, message_of(error), "add ?width_mm=W&height_mm=H, or calibrate") from None

    def _report_axes(self, device: TouchDevice) -> None:
        for axis, size_mm in zip(device.description.axes, self._panel_mm, strict=True):
            if axis.fuzz:
                words = message(
                    "{axis} has a fuzz of {fuzz}: the kernel smooths slow motion, which is a latency of its own. Set "
                    "it to 0 unless it is under test.",
                    axis=axis.name,
                    fuzz=axis.fuzz,
                )
                self._report("warning", words)
            if size_mm and axis.resolution > 0:
                said_mm = (axis.maximum - axis.minimum + 1) / axis.resolution
                if abs(said_mm / size_mm - 1) > SIZE_TOLERANCE:
                    words = message(
                        "{axis} is {said:.1f} mm long by its resolution and {size:.1f} mm by the panel: measure with a "
                        "ruler, or calibrate.",
                        axis=axis.name,
                        said=said_mm,
                        size=size_mm,
                    )
                    self._report("warning", words)

    def _lose(self, fault: Gone) -> Batch:
        if self._device is not None:
            self._device.close()
        self._device = None
        self._next_try_s = self._now() + RETRY_S
        name, why = self._identity[0], message_of(fault)
        words = message("{name} is gone ({why}). Plug it in again; it goes on then.", name=name, why=why)
        self._report("error", words, "lost")
        return self._batch(alive=False)

    def _while_lost(self, timeout_s: float) -> Batch:
        now_s = self._now()
        if now_s < self._next_try_s:
            self._pause(min(timeout_s, self._next_try_s - now_s))
        if self._now() >= self._next_try_s:
            self._next_try_s = self._now() + RETRY_S
            self._come_back()
        now_s, back = self._now(), self._device is not None
        touch: TouchTrace | None = None
        if back or now_s - self._until_s >= GAP_EVERY_S:
            touch = replace(empty_touch(), gaps_s=np.array([[self._until_s, now_s]]), dropped=int(back))
            self._until_s = now_s
        return self._batch(touch=touch, alive=back)

    def _come_back(self) -> None:
        for seen in self._find_devices():
            if (seen.name, seen.phys, seen.uniq) != self._identity:
                continue
            try:
                device = self._connect(seen.path)
            except DeviceError:
                continue  # its node is there before its rights are
            self._device, self._path = device, seen.path
            self._returns += 1
            self._report(
                "info", message("{name} is back at {path} and records again.", name=seen.name, path=seen.path), "back"
            )
            return

    # --- events -----------------------------------------------------------------------------------------------

    def _decode(self, device: TouchDevice, events: list[InputEvent]) -> list[Frame]:
        frames: list[Frame] = []
        for event in events:
            if event.t_s <= self._known_s:
                continue
            if event.type == EV_SYN and event.code == SYN_DROPPED:
                self._syncing = True
                self._report(
                    "warning", message("The kernel's buffer overflowed: touch events were lost, the gap is marked.")
                )
            frame = self._decoder.feed(event)
            if self._syncing and event.type == EV_SYN and event.code == SYN_REPORT:
                self._syncing = False
                # The buffer still holds events from before this moment, which the slots are ahead of.
                self._known_s = self._now()
                self._decoder.resync(*device.slots())
            if frame is not None:
                frames.append(frame)
        self._say_useless(self._useless.take(events, any(frame.contacts for frame in frames)))
        return frames

    def _say_useless(self, seen: str) -> None:
        if seen:
            words = message(
                "{name} sends events that are no touch ({axes}), and nothing is recorded of them. Choose another input "
                "device: draglag devices lists touchscreens.",
                name=self._identity[0],
                axes=seen,
            )
            self._report("error", words)

    def _trace(self, frames: list[Frame]) -> TouchTrace | None:
        if not frames or self._mapping is None:
            return None
        if not self._clock_reported and abs(frames[-1].t_s - self._now()) > OTHER_CLOCK_S:
            self._clock_reported = True
            self._report(
                "error", message("Touch events are not stamped on the host's monotonic clock: latencies will be wrong.")
            )
        trace = touch_trace(frames, self._mapping, follower=self._follower)
        gaps = trace.gaps_s.copy()
        if frames[0].dropped and self._last_frame_s is not None:
            gaps[0, 0] = self._last_frame_s  # the frame before it came with an earlier read
        self._last_frame_s = frames[-1].t_s
        if not len(trace.t_s) and not trace.dropped:
            return None
        return replace(trace, gaps_s=gaps, contact_id=trace.contact_id + self._returns * _IDS)

    # --- exclusive use ----------------------------------------------------------------------------------------

    def _grab_when_free(self, device: TouchDevice) -> None:
        """Take the device only while nothing is down: a program that saw a touch begin must see it end."""
        if not self._exclusive or self._grabbed or _is_down(device):
            return
        try:
            device.grab(True)
        except OSError as error:
            if error.errno == errno.ENODEV:
                raise Gone(message("unplugged")) from None
            self._exclusive = False
            why = message("another program holds it") if error.errno == errno.EBUSY else cause(error)
            self._report("warning", message("The touchscreen is not used exclusively: {why}.", why=why))
            return
        if _is_down(device):  # since the look before: let go at once, and wait for its end
            with contextlib.suppress(OSError):  # a lost device is reported by the next read
                device.grab(False)
            return
        self._grabbed = True

    def _ungrab(self, device: TouchDevice) -> None:
        deadline_s = self._now() + _UNGRAB_TIMEOUT_S
        while _is_down(device) and self._now() < deadline_s:
            device.events(0.05)
        device.grab(False)

    # --- handing on -------------------------------------------------------------------------------------------

    def _report(self, level: str, text: str, state: str = "") -> None:
        self._notices.append(Notice(self._now(), level, text, state))

    def _batch(
        self, alive: bool = True, touch: TouchTrace | None = None, contacts: ContactChanges | None = None
    ) -> Batch:
        notices, self._notices = tuple(self._notices), []
        return Batch(self._until_s, touch=touch, notices=notices, alive=alive, contacts=contacts)


def _is_down(device: TouchDevice) -> bool:
    slots, _ = device.slots()
    return any(contact >= 0 for contact, _, _ in slots.values())
