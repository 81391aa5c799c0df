"""Logs of ``evtest``: a description, then lines "Event: time 12.345678, …"."""

from __future__ import annotations

import re
from pathlib import Path

from draglag.errors import DataError
from draglag.exchange.importers.input_log import InputLog, checked_event, refuse_step_back, whole
from draglag.messages import message
from draglag.reading import plain_lines
from draglag.recording import AxisInfo
from draglag.touch_events.frames import (
    AXIS_NAMES,
    EV_ABS,
    EV_MSC,
    EV_SYN,
    MSC_TIMESTAMP,
    SYN_DROPPED,
    SYN_REPORT,
    InputEvent,
)
from draglag.touch_events.packets import SYN_MT_REPORT

_EVENT = re.compile(
    r"Event: time (?P<time>\d{1,12}\.\d{1,9}), type (?P<type>\d{1,5}) \([^)]*\), code (?P<code>\d{1,5}) \([^)]*\), "
    r"value (?P<value>-?\w{1,11})\s*\Z"
)
_MARK = re.compile(r"Event: time (?P<time>\d{1,12}\.\d{1,9}), [-+><]+ (?P<name>\w+(?: Sync)?) [-+><]+\s*\Z")
_MARKS = {
    "SYN_REPORT": SYN_REPORT,
    "Report Sync": SYN_REPORT,
    "SYN_MT_REPORT": SYN_MT_REPORT,
    "SYN_DROPPED": SYN_DROPPED,
}
_NAME = re.compile(r'Input device name: "(.*)"')
_TYPE = re.compile(r"\s*Event type (\d{1,5})\b")
_CODE = re.compile(r"\s*Event code (\d{1,5})\b")
_RANGE = re.compile(r"\s*(Min|Max|Fuzz|Resolution)\s+(-?\d{1,11})\s*\Z")
_FIELDS = {"Min": "minimum", "Max": "maximum", "Fuzz": "fuzz", "Resolution": "resolution"}


def read_evtest(path: Path) -> InputLog:
    """A log's events, without a last line that is cut off: evtest was ended while it wrote it. Raises DataError."""
    return parse_evtest(plain_lines(path).decode("utf-8", errors="replace"), str(path))


def parse_evtest(text: str, where: str = "text") -> InputLog:
    """As ``read_evtest``, of a text."""
    events: list[InputEvent] = []
    head: list[str] = []
    lines = text.split("\n")
    last = len(lines) - (not lines[-1])
    cut = bool(lines[-1]) and not lines[-1].startswith("Event:")
    for number, line in enumerate(lines, 1):
        if not line.startswith("Event:"):
            head.append(line)
            continue
        event = _event(line)
        if event is None and number == last:
            cut = True
            break
        if event is None:
            raise DataError(
                message(
                    "{path}, line {line}: “{text}” is not an event of evtest", path=where, line=number, text=line[:60]
                ),
                "Correct or remove that line",
            )
        events.append(event)
        refuse_step_back(events, where, number)
    if not events:
        raise DataError(
            message("{path}: holds no events of evtest", path=where), "Expected lines that begin with “Event: time”"
        )
    name, axes = _described(head)
    return InputLog(name, tuple(events), axes, cut=cut)


def _event(line: str) -> InputEvent | None:
    try:
        if mark := _MARK.match(line):
            return checked_event(float(mark["time"]), EV_SYN, _MARKS.get(mark["name"], 1), 0)
        if found := _EVENT.match(line):
            kind, code = int(found["type"]), int(found["code"])
            # Scan codes are printed as hexadecimal numbers.
            base = 16 if kind == EV_MSC and code != MSC_TIMESTAMP else 10
            return checked_event(float(found["time"]), kind, code, whole(found["value"], base))
    except ValueError:
        return None
    return None


def _described(lines: list[str]) -> tuple[str, dict[int, AxisInfo]]:
    name, kind, code = "", -1, -1
    ranges: dict[int, dict[str, int]] = {}
    for line in lines:
        if found := _NAME.match(line):
            name = found[1]
        elif found := _TYPE.match(line):
            kind = int(found[1])
        elif found := _CODE.match(line):
            code = int(found[1])
        elif kind == EV_ABS and (found := _RANGE.match(line)):
            ranges.setdefault(code, {})[_FIELDS[found[1]]] = int(found[2])
    return name, {
        code: AxisInfo(AXIS_NAMES.get(code, f"ABS_{code:#04x}"), **known)
        for code, known in ranges.items()
        if {"minimum", "maximum"} <= set(known)
    }
