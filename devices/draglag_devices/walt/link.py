"""Commands to a WALT, and its lines."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from draglag_devices.walt.port import Port
from draglag_devices.walt.protocol import PING, Trigger, acknowledgement, parse_trigger

_T = TypeVar("_T")

ANSWER_S = 0.3
SETTLE_S = 1.0
# No line of the WALT is longer; a stream without line ends is not one.
_LONGEST_LINE = 200
_STALE_READS = 256


class NoAnswer(Exception):
    """The device does not answer."""


@dataclass(frozen=True)
class Answer(Generic[_T]):
    """An answer; host times just before its question and just after its arrival."""

    value: _T
    sent_s: float
    arrived_s: float


class Link:
    """One conversation; its methods may raise PortGone. ``unread`` counts lines not understood."""

    def __init__(
        self, port: Port, now: Callable[[], float] = time.monotonic, pause: Callable[[float], None] = time.sleep
    ) -> None:
        self._port = port
        self.now = now
        self.pause = pause
        self.unread = 0
        self._pending = b""
        self._lines: list[tuple[str, float]] = []
        self._triggers: list[Trigger] = []

    def send(self, command: str) -> float:
        """Host time just before the command was sent."""
        sent_s = self.now()
        self._port.write(command.encode("ascii"))
        return sent_s

    def ask(
        self, command: str, accept: Callable[[str], _T | None], timeout_s: float = ANSWER_S, late: bool = False
    ) -> Answer[_T]:
        """The line that ``accept`` takes, after a command. Raises NoAnswer.

        A late line answers no later question. ``late`` accepts one that comes before a ping's answer.
        """
        sent_s = self.send(command)
        try:
            value, arrived_s = self.expect(accept, timeout_s)
        except NoAnswer:
            found = self.settle(accept)
            if found is None or not late:
                raise
            value, arrived_s = found
        return Answer(value, sent_s, arrived_s)

    def acknowledged(self, command: str, timeout_s: float = ANSWER_S) -> Answer[str]:
        """The acknowledgement of a command, even late. Raises NoAnswer."""
        wanted = acknowledgement(command)
        return self.ask(command, lambda text: text if text == wanted else None, timeout_s, late=True)

    def expect(self, accept: Callable[[str], _T | None], timeout_s: float = ANSWER_S) -> tuple[_T, float]:
        """The next line that ``accept`` takes, and its host time. Raises NoAnswer."""
        deadline_s = self.now() + timeout_s
        while True:
            while self._lines:
                text, arrived_s = self._lines.pop(0)
                value = accept(text)
                if value is not None:
                    return value, arrived_s
                self.unread += 1
            left_s = deadline_s - self.now()
            if left_s <= 0:
                raise NoAnswer
            self._receive(left_s)

    def settle(self, accept: Callable[[str], _T | None] = lambda text: None) -> tuple[_T, float] | None:
        """The first line that ``accept`` takes before a ping's answer: by then earlier questions are answered. Raises
        NoAnswer."""
        wanted = acknowledgement(PING)
        self.send(PING)
        found: tuple[_T, float] | None = None
        while True:
            text, arrived_s = self.expect(
                lambda text: text if text == wanted or accept(text) is not None else None, SETTLE_S
            )
            if text == wanted:
                return found
            value = accept(text)
            if found is None and value is not None:
                found = value, arrived_s

    def listen(self, timeout_s: float) -> None:
        """Wait for unasked lines."""
        self._receive(timeout_s)
        self.unread += len(self._lines)
        self._lines.clear()

    def take_triggers(self) -> list[Trigger]:
        """Trigger lines since the last call."""
        taken, self._triggers = self._triggers, []
        return taken

    def forget(self) -> None:
        """Drop all received: a fresh port holds an earlier conversation."""
        for _ in range(_STALE_READS):
            if not self._port.read(0.0):
                break
        self._pending = b""
        self._lines.clear()
        self._triggers.clear()

    def close(self) -> None:
        self._port.close()

    def _receive(self, timeout_s: float) -> None:
        data = self._port.read(timeout_s)
        arrived_s = self.now()
        *whole, self._pending = (self._pending + data).split(b"\n")
        if len(self._pending) > _LONGEST_LINE:
            self._pending = b""
            self.unread += 1
        for raw in whole:
            text = raw.strip().decode("ascii", errors="replace")
            trigger = parse_trigger(text)
            if trigger is not None:
                self._triggers.append(trigger)
            elif text:
                self._lines.append((text, arrived_s))
