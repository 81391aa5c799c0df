"""Event devices in sysfs, which needs no rights."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from draglag.touch_events.frames import ABS_MT_POSITION_X, ABS_X, ABS_Y, BTN_TOUCH

SYSFS = Path("/sys/class/input")
_PROP_DIRECT = 0x01


@dataclass(frozen=True)
class EventDevice:
    """An event device as sysfs describes it."""

    path: str
    name: str
    phys: str
    uniq: str
    touchscreen: bool

    @property
    def usable(self) -> bool:
        return os.access(self.path, os.R_OK | os.W_OK)


def event_devices(sysfs: Path = SYSFS) -> list[EventDevice]:
    """All event devices, by number."""
    folders = [folder for folder in sysfs.glob("event*") if folder.name[5:].isdecimal()]
    return [_event_device(folder) for folder in sorted(folders, key=lambda folder: int(folder.name[5:]))]


def _event_device(folder: Path) -> EventDevice:
    device = folder / "device"
    axes, keys = _bits(device / "capabilities" / "abs"), _bits(device / "capabilities" / "key")
    touches = ABS_MT_POSITION_X in axes or ({ABS_X, ABS_Y} <= axes and BTN_TOUCH in keys)
    direct = _PROP_DIRECT in _bits(device / "properties")
    path = f"/dev/input/{folder.name}"
    return EventDevice(path, _text(device / "name"), _text(device / "phys"), _text(device / "uniq"), touches and direct)


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""


def _bits(path: Path) -> set[int]:
    bits: set[int] = set()
    try:
        words = [int(word, 16) for word in _text(path).split()]
    except ValueError:
        return bits
    for place, word in enumerate(reversed(words)):
        bits |= {64 * place + bit for bit in range(64) if word >> bit & 1}
    return bits
