"""Touchscreens through the kernel's evdev interface."""

from __future__ import annotations

import importlib.util

from draglag.messages import message
from draglag.system.packages import advice
from draglag_devices.addresses import Address, parse_address
from draglag_devices.discovery import Found
from draglag_devices.evdev_touch.finding import event_devices
from draglag_devices.evdev_touch.kernel import RIGHTS_REMEDY
from draglag_devices.evdev_touch.source import EvdevTouch

OPTIONS = ("width_mm", "height_mm", "calibration", "exclusive")


def open_source(address: Address | str, role: str = "touch") -> EvdevTouch:
    """The touchscreen at ``evdev:PATH``, not yet open. Raises DeviceError.

    Options: ``width_mm``, ``height_mm`` of the panel (default: by its resolution), ``calibration=FILE``,
    ``exclusive=1`` (no other program gets its events).
    """
    parsed = parse_address(address) if isinstance(address, str) else address
    parsed.only(*OPTIONS)
    return EvdevTouch(parsed)


def discover() -> list[Found]:
    """Touchscreens, also without the library that reads them."""
    found = []
    for seen in event_devices():
        if seen.touchscreen:
            words, remedy = seen.name or message("touchscreen"), "" if seen.usable else RIGHTS_REMEDY
            if not _has_library():
                problem, remedy = advice("evdev")
                words = message("{name}: {problem}", name=words, problem=problem)
            found.append(Found(f"evdev:{seen.path}", ("touch",), words, not remedy, remedy))
    return found


def _has_library() -> bool:
    try:
        return importlib.util.find_spec("evdev") is not None
    except ValueError:  # it is marked as missing
        return False
