"""evemu recordings (``evemu-record``): lines E: (events) and A: (axes)."""

from __future__ import annotations

import re
from pathlib import Path

from draglag.errors import DataError
from draglag.exchange.importers.input_log import InputLog, checked_event, refuse_step_back, whole
from draglag.messages import message
from draglag.reading import plain_lines
from draglag.recording import AxisInfo
from draglag.touch_events.frames import AXIS_NAMES, InputEvent

# evemu writes 0x0 where the panel does not say its size.
_SIZE = re.compile(r"# Size in mm: ([1-9]\d{0,4})x([1-9]\d{0,4})\s*$")


def read_evemu(path: Path) -> InputLog:
    """A recording's events. Raises DataError."""
    return parse_evemu(plain_lines(path).decode("utf-8", errors="replace"), str(path))


def parse_evemu(text: str, where: str = "text") -> InputLog:
    """As ``read_evemu``, of a text."""
    name = ""
    events: list[InputEvent] = []
    axes: dict[int, AxisInfo] = {}
    size_mm = None
    for number, full_line in enumerate(text.split("\n"), 1):
        if found := _SIZE.match(full_line):
            size_mm = (float(found[1]), float(found[2]))
        line = full_line.split("#", 1)[0].strip()
        if line.startswith("N:"):
            name = full_line[2:].strip()
            continue
        if not line.startswith(("E:", "A:")):
            continue
        words = line[2:].split()
        try:
            if line.startswith("E:"):
                events.append(_event(words))
            else:
                code, axis = _axis(words)
                axes[code] = axis
        except (ValueError, IndexError):
            expected = "E: <seconds> <type> <code> <value>" if line[0] == "E" else "A: <axis> <min> <max> <fuzz> <flat>"
            raise DataError(
                message(
                    "{path}, line {line}: '{text}' is not '{expected}'",
                    path=where,
                    line=number,
                    text=line[:60],
                    expected=expected,
                )
            ) from None
        refuse_step_back(events, where, number)
    if not events:
        raise DataError(
            message("{path}: holds no E: lines", path=where), "an evemu recording is expected (evemu-record)"
        )
    return InputLog(name, tuple(events), axes, size_mm)


def _event(words: list[str]) -> InputEvent:
    return checked_event(float(words[0]), whole(words[1], 16), whole(words[2], 16), whole(words[3]))


def _axis(words: list[str]) -> tuple[int, AxisInfo]:
    code, values = whole(words[0], 16), [whole(word) for word in words[1:]]
    if not all(-(2**31) <= value < 2**32 for value in values):
        raise ValueError("beyond what the field holds")
    resolution = values[4] if len(values) > 4 else 0  # version 1.0 of the format has no resolution
    return code, AxisInfo(AXIS_NAMES.get(code, f"ABS_{code:#04x}"), values[0], values[1], resolution, values[2])
