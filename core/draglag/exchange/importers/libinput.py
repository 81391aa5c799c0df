"""Recordings of ``libinput record`` (YAML, version 1)."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

from draglag.errors import DataError
from draglag.exchange.importers.input_log import InputLog, checked_event, refuse_step_back, whole
from draglag.messages import message
from draglag.reading import plain_lines
from draglag.recording import AxisInfo
from draglag.touch_events.frames import ABS_MT_POSITION_X, ABS_X, AXIS_NAMES, EV_ABS, InputEvent

_DEVICE = re.compile(r"\s*- node:")
_NAME = re.compile(r'\s+name: "(.*)"')
_AXIS = re.compile(r"\s+(\d{1,3}): \[([-\d, ]+)\]\s*\Z")
_EVENT = re.compile(r"\s+- \[([-\d, ]+)\]\s*(?:#.*)?\Z")
_SECTION = re.compile(r"\s*(?:- )?(\w+):\s*\Z")


@dataclass
class _Device:
    name: str = ""
    axes: dict[int, AxisInfo] = field(default_factory=dict)
    events: list[InputEvent] = field(default_factory=list)

    def positions(self) -> int:
        return sum(event.type == EV_ABS and event.code in (ABS_X, ABS_MT_POSITION_X) for event in self.events)


def read_libinput(path: Path) -> InputLog:
    """The device with most positions. Raises DataError."""
    return parse_libinput(plain_lines(path).decode("utf-8", errors="replace"), str(path))


def parse_libinput(text: str, where: str = "text") -> InputLog:
    """As ``read_libinput``, of a text, line by line: general YAML readers take minutes and gigabytes."""
    devices: list[_Device] = []
    section = ""
    for number, line in enumerate(text.split("\n"), 1):
        if line.startswith("version:") and line.partition(":")[2].strip() != "1":
            raise DataError(
                message(
                    "{path}, line {line}: only version 1 of libinput's recordings is known", path=where, line=number
                )
            )
        if _DEVICE.match(line):
            devices.append(_Device())
        elif found := _SECTION.match(line):
            section = found[1]
        elif devices:
            try:
                _take(devices[-1], section, line)
            except (ValueError, IndexError):
                problem = f"{where}, line {number}: “{line.strip()[:60]}” is not what libinput record writes"
                raise DataError(problem, "Correct or remove that line") from None
            refuse_step_back(devices[-1].events, where, number)
    device = max(devices, key=_Device.positions, default=_Device())
    if not device.events:
        raise DataError(
            message("{path}: holds no events of a device", path=where), "A recording of libinput record is expected"
        )
    return InputLog(device.name, tuple(device.events), device.axes)


def _take(device: _Device, section: str, line: str) -> None:
    if section == "evdev" and (found := _NAME.match(line)):
        device.name = found[1]
    elif section == "absinfo" and (found := _AXIS.match(line)):
        code = int(found[1])
        values = [whole(word) for word in found[2].split(",")]
        name = AXIS_NAMES.get(code, f"ABS_{code:#04x}")
        device.axes[code] = AxisInfo(name, values[0], values[1], values[4], values[2])
    elif section == "evdev" and line.lstrip().startswith("- ["):
        found = _EVENT.match(line)
        if found is None:
            raise ValueError("not an event")
        seconds, micro, kind, code, value = (whole(word) for word in found[1].split(","))
        device.events.append(checked_event(seconds + 1e-6 * micro, kind, code, value))
