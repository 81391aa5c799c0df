"""Comparisons of the WALT's clock with the host's (fact sheet, steps 1 to 3).

E = host − device. What the host sent before the device's stamp bounds E from below, what it received after from above:
delays of the operating system cannot bias the bounds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from draglag.recording import ClockBounds
from draglag_devices.walt.link import Link, NoAnswer
from draglag_devices.walt.protocol import (
    DIGITS,
    READ_DIGIT,
    SEND_DIGITS,
    TIME,
    ZERO,
    Unwrapped,
    parse_sync,
    parse_time,
)

REPEATS = 7
# The device cuts its stamps to whole microseconds: the moment was up to this much later.
_TICK_S = 1e-6
_PAUSE_S = (70e-6, 700e-6)
# A line damaged on the wire can still look like a number; a bound off by more than this contradicts the others.
_TOLERANCE_S = 1e-3


@dataclass(frozen=True)
class Bound:
    """The device time happened between two host times."""

    device_s: float
    host_min_s: float
    host_max_s: float

    @property
    def width_s(self) -> float:
        return self.host_max_s - self.host_min_s


def as_bounds(stream: str, rows: list[Bound], epoch: int) -> ClockBounds:
    """Comparisons as the file keeps them."""
    table = np.array([(b.device_s, b.host_min_s, b.host_max_s) for b in rows]).reshape(-1, 3)
    return ClockBounds(stream, table[:, 0], table[:, 1], table[:, 2], np.full(len(rows), epoch, np.int64))


def zero(link: Link) -> Bound:
    """Zero the device's clock: 0 ≤ E ≤ round trip. Raises PortGone, NoAnswer."""
    answer = link.acknowledged(ZERO)
    return Bound(0.0, answer.sent_s, answer.arrived_s)


def request_time(link: Link, unwrapped: Unwrapped) -> Bound:
    """One quick comparison. Raises PortGone, NoAnswer."""
    answer = link.ask(TIME, parse_time)
    device_s = unwrapped(answer.value)
    return Bound(device_s, answer.sent_s - _TICK_S, answer.arrived_s)


def compare(
    link: Link,
    unwrapped: Unwrapped,
    known: Bound,
    repeats: int = REPEATS,
    between: Callable[[], None] = lambda: None,
) -> list[Bound]:
    """One bound per repeat, without damaged ones, in about 0.15 s. Raises PortGone.

    Args:
        known: a present bound that others must not contradict.
        between: called before each half of a repeat, for what cannot wait.
    """
    low, high = known.host_min_s - known.device_s, known.host_max_s - known.device_s
    rows: list[Bound] = []
    for _ in range(repeats):
        between()
        try:
            below = _digits_out(link, unwrapped, high - low)
            between()
            above = _digits_in(link, unwrapped)
        except NoAnswer:
            continue
        below = [(device, e) for device, e in below if e <= high + _TOLERANCE_S]
        above = [(device, e) for device, e in above if e >= low - _TOLERANCE_S]
        if not below or not above:
            continue
        least, most = max(e for _, e in below), min(e for _, e in above)
        if least > most:
            continue
        low, high = max(low, least), max(min(high, most), low)
        middle = float(np.mean([device for device, _ in below + above]))
        rows.append(Bound(middle, middle + least, middle + most))
    return rows


def _digits_out(link: Link, unwrapped: Unwrapped, width_s: float) -> list[tuple[float, float]]:
    pause_s = min(max(width_s / 10, _PAUSE_S[0]), _PAUSE_S[1])
    sent: dict[int, float] = {}
    for digit in DIGITS:
        sent[int(digit)] = link.send(digit)
        link.pause(pause_s)
    received = _readout(link, unwrapped)
    return [(device, sent[n] - device - _TICK_S) for n, device in received.items() if n in sent]


def _digits_in(link: Link, unwrapped: Unwrapped) -> list[tuple[float, float]]:
    link.send(SEND_DIGITS)
    arrived: dict[int, float] = {}
    try:
        while 9 not in arrived:
            digit, arrived_s = link.expect(_digit)
            arrived.setdefault(digit, arrived_s)
    except NoAnswer:
        link.settle()
    sent = _readout(link, unwrapped)
    return [(device, arrived[n] - device) for n, device in sent.items() if n in arrived]


def _readout(link: Link, unwrapped: Unwrapped) -> dict[int, float]:
    stored: dict[int, float] = {}
    for _ in DIGITS:
        try:
            n, us = link.ask(READ_DIGIT, parse_sync).value
        except NoAnswer:
            continue
        if 1 <= n <= 9:
            stored[n] = unwrapped(us)
    return stored


def _digit(text: str) -> int | None:
    return int(text) if len(text) == 1 and text in DIGITS else None
