"""evemu recordings (``evemu-record``): text lines E: (events) and A: (axes), plain or gzipped."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from draglag.errors import DataError
from draglag.reading import plain_lines
from draglag.reading.limits import CONTACTS, TIME_S
from draglag.recording import AxisInfo
from draglag_devices.touch.frames import (
    ABS_MT_POSITION_X,
    ABS_MT_POSITION_Y,
    ABS_MT_SLOT,
    ABS_X,
    ABS_Y,
    AXIS_NAMES,
    EV_ABS,
    EV_SYN,
    Frame,
    InputEvent,
    decode,
)
from draglag_devices.touch.packets import SYN_MT_REPORT, decode_packets


@dataclass(frozen=True)
class EvemuRecording:
    """What a recording holds. ``axes``: axis code → its range; empty where the file has no A: lines."""

    name: str
    events: tuple[InputEvent, ...]
    axes: dict[int, AxisInfo]

    @property
    def multitouch(self) -> bool:
        """Whether positions come as ABS_MT_POSITION_*."""
        return ABS_MT_POSITION_X in self.axes or any(
            event.type == EV_ABS and event.code == ABS_MT_POSITION_X for event in self.events
        )

    @property
    def without_slots(self) -> bool:
        """Whether contacts are listed frame by frame (multi-touch protocol A), not kept in slots."""
        kinds = {(event.type, event.code) for event in self.events}
        slots = ABS_MT_SLOT in self.axes or (EV_ABS, ABS_MT_SLOT) in kinds
        return self.multitouch and not slots and (EV_SYN, SYN_MT_REPORT) in kinds

    def frames(self) -> list[Frame]:
        """What the recording holds, frame by frame."""
        if self.without_slots:
            return list(decode_packets(self.events))
        return list(decode(self.events, self.multitouch))

    def position_axes(self) -> tuple[AxisInfo, AxisInfo] | None:
        """The x and y axis that positions are read from, or None where the file does not describe them."""
        codes = (ABS_MT_POSITION_X, ABS_MT_POSITION_Y) if self.multitouch else (ABS_X, ABS_Y)
        if codes[0] in self.axes and codes[1] in self.axes:
            return self.axes[codes[0]], self.axes[codes[1]]
        return None


def read_evemu(path: Path) -> EvemuRecording:
    """Read a recording. Raises DataError naming the file and the line that cannot be read."""
    return parse_evemu(plain_lines(path).decode("utf-8", errors="replace"), str(path))


def parse_evemu(text: str, where: str = "text") -> EvemuRecording:
    """Parse the text of a recording. Raises DataError naming the line that cannot be read."""
    name = ""
    events: list[InputEvent] = []
    axes: dict[int, AxisInfo] = {}
    for number, full_line in enumerate(text.split("\n"), 1):
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
            raise DataError(f"{where}, line {number}: '{line[:60]}' is not '{expected}'") from None
        if len(events) > 1 and events[-1].t_s < events[-2].t_s:
            raise DataError(f"{where}, line {number}: the time goes back", "record again, or correct that line")
    if not events:
        raise DataError(f"{where}: holds no E: lines", "an evemu recording is expected (evemu-record)")
    return EvemuRecording(name, tuple(events), axes)


def _event(words: list[str]) -> InputEvent:
    """Raises ValueError, also for numbers that the kernel's struct input_event cannot hold."""
    kind, code = (_whole(word, 16, 0, 0xFFFF) for word in words[1:3])
    event = InputEvent(float(words[0]), kind, code, _value(words[3]))
    if not 0 <= event.t_s <= TIME_S:
        raise ValueError("no time")
    if (event.type, event.code) == (EV_ABS, ABS_MT_SLOT) and not 0 <= event.value < CONTACTS:
        raise ValueError("no slot of a touchscreen")
    return event


def _axis(words: list[str]) -> tuple[int, AxisInfo]:
    """Raises ValueError."""
    code, values = _whole(words[0], 16, 0, 0xFFFF), [_value(word) for word in words[1:]]
    resolution = values[4] if len(values) > 4 else 0  # version 1.0 of the format has no resolution
    return code, AxisInfo(AXIS_NAMES.get(code, f"ABS_{code:#04x}"), values[0], values[1], resolution, values[2])


def _value(word: str) -> int:
    return _whole(word, 10, -(2**31), 2**32 - 1)  # 32 bits; unsigned where a stamp was written so


def _whole(word: str, base: int, least: int, most: int) -> int:
    if len(word) > 11:
        raise ValueError("too many digits")
    number = int(word, base)
    if not least <= number <= most:
        raise ValueError("beyond what the field holds")
    return number
