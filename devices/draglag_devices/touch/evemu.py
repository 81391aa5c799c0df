"""evemu recordings (``evemu-record``): text lines E: (events) and A: (axes), plain or gzipped."""

from __future__ import annotations

import gzip
import zlib
from dataclasses import dataclass
from pathlib import Path

from draglag.errors import DataError
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
    try:
        raw = path.read_bytes()
        if raw[:2] == b"\x1f\x8b":
            raw = gzip.decompress(raw)
    except (OSError, EOFError, zlib.error) as error:
        raise DataError(f"{path}: cannot be read ({error})", "check the path and that the file is whole") from None
    return parse_evemu(raw.decode("utf-8", errors="replace"), str(path))


def parse_evemu(text: str, where: str = "text") -> EvemuRecording:
    """Parse the text of a recording. Raises DataError naming the line that cannot be read."""
    name = ""
    events: list[InputEvent] = []
    axes: dict[int, AxisInfo] = {}
    for number, full_line in enumerate(text.splitlines(), 1):
        line = full_line.split("#", 1)[0].strip()
        if line.startswith("N:"):
            name = full_line[2:].strip()
            continue
        if not line.startswith(("E:", "A:")):
            continue
        words = line[2:].split()
        try:
            if line.startswith("E:"):
                events.append(InputEvent(float(words[0]), int(words[1], 16), int(words[2], 16), int(words[3])))
            else:
                code, values = int(words[0], 16), [int(word) for word in words[1:]]
                resolution = values[4] if len(values) > 4 else 0  # version 1.0 of the format has no resolution
                axes[code] = AxisInfo(
                    AXIS_NAMES.get(code, f"ABS_{code:#04x}"), values[0], values[1], resolution, values[2]
                )
        except (ValueError, IndexError):
            expected = "E: <seconds> <type> <code> <value>" if line[0] == "E" else "A: <axis> <min> <max> <fuzz> <flat>"
            raise DataError(f"{where}, line {number}: '{line[:60]}' is not '{expected}'") from None
    if not events:
        raise DataError(f"{where}: holds no E: lines", "an evemu recording is expected (evemu-record)")
    return EvemuRecording(name, tuple(events), axes)
