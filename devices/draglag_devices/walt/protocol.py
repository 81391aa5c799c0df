"""The WALT's lines (firmware 6; source: the fact sheet, protocol table)."""

from __future__ import annotations

import re
from dataclasses import dataclass

KNOWN_VERSION = "6"
BAUD = 115200
USB_VENDOR = 0x16C0

ZERO, TIME, PING, PING_LATER, RESET, VERSION = "Z", "T", "P", "D", "F", "V"
SEND_DIGITS, READ_DIGIT = "I", "R"
LASER_ON, LASER_OFF, LASER_LAST = "L", "l", "J"
SCREEN_OFF, SHOCK = "c", "G"

LASER_TAG = "L"
DIGITS = "123456789"
WRAP_US = 1 << 32

_TRIGGER = re.compile(r"G ([A-Z]) (-?\d{1,10}) (-?\d{1,6}) (-?\d{1,6})")
_TIME = re.compile(r"t (-?\d{1,10})")
_SYNC = re.compile(r"(\d{1,2}):(-?\d{1,10})")
_SHOCK = re.compile(r"-?\d{1,10}")
_VERSION = re.compile(r"v (\S+)")


@dataclass(frozen=True)
class Trigger:
    """A change of laser ("L", value 1 = light) or screen ("S"); ``count`` since the last line."""

    tag: str
    us: int
    value: int
    count: int


def acknowledgement(command: str) -> str:
    """The command's letter in the other case."""
    return command.swapcase()


def parse_trigger(text: str) -> Trigger | None:
    """``G <tag> <us> <val> <count>``"""
    words = _TRIGGER.fullmatch(text)
    return Trigger(words[1], int(words[2]), int(words[3]), int(words[4])) if words else None


def parse_time(text: str) -> int | None:
    """``t <us>``"""
    words = _TIME.fullmatch(text)
    return int(words[1]) if words else None


def parse_sync(text: str) -> tuple[int, int] | None:
    """``<n>:<us>`` of a digit, n = 10 for no more."""
    words = _SYNC.fullmatch(text)
    return (int(words[1]), int(words[2])) if words else None


def parse_shock(text: str) -> int | None:
    """Microseconds of the last shock, 0 = none."""
    return int(text) if _SHOCK.fullmatch(text) else None


def parse_version(text: str) -> str | None:
    """``v <version>``"""
    words = _VERSION.fullmatch(text)
    return words[1] if words else None


class Unwrapped:
    """The signed 32-bit count of µs, unwrapped; valid if stamps come at least every 35 minutes."""

    def __init__(self) -> None:
        self._latest_us = 0

    def __call__(self, us: int) -> float:
        """Seconds since the clock was zeroed."""
        ahead = (us - self._latest_us + WRAP_US // 2) % WRAP_US - WRAP_US // 2
        whole = self._latest_us + ahead
        return whole * 1e-6

    def advance(self, device_s: float) -> None:
        """Use a stamp known to be good."""
        self._latest_us = max(self._latest_us, round(device_s * 1e6))
