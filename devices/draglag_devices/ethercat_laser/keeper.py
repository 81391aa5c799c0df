"""Runs the bus in forks of this process, one after another; one without progress is ended.

SOEM cannot be interrupted: after a late answer it can read address 0's EEPROM byte by byte for half a minute.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NoReturn

from draglag.messages import message, phrase, unpacked
from draglag_devices.ethercat_laser import preflight
from draglag_devices.ethercat_laser.probe import count_slaves
from draglag_devices.ethercat_laser.refusal import Refusal
from draglag_devices.ethercat_laser.waits import (
    DEAD_GAP_NS,
    EXIT_S,
    LONG_S,
    PAUSES_S,
    POLL_S,
    PROBE_PAUSES_S,
    PROMPT_ANSWER_S,
    SILENCE_S,
    STUCK_S,
)
from draglag_devices.ethercat_laser.wire import ReaderGone, Wire

_FIRST_TRIES = 5
# What answers that got lost or came late on a busy computer may look like.
_WORTH_A_TRY = ("no_slaves", "unsteady", "state", "set_up")
_PR_SET_PDEATHSIG = 1

Life = Callable[[int, Wire], None]


class Crashed(Exception):
    """The child ended without a report."""


@dataclass(frozen=True)
class End:
    """How a child ended. ``ran``: the bus was lost for ``reason``; else ``refusal``."""

    ran: bool
    reason: str = ""
    refusal: Refusal | None = None
    hung: bool = False


class Keeper:
    """Runs the bus until the reader goes.

    Args:
        life: runs the bus in the child, given the epoch's number.
        first_epoch: above 0 where an earlier process ran the bus.
    """

    def __init__(self, interface: str, wire: Wire, life: Life, first_epoch: int = 0) -> None:
        self.interface, self.wire, self._life = interface, wire, life
        self.number = first_epoch
        self._first = first_epoch == 0
        self._until: int | None = None  # host time up to which all edges have been reported
        self._level: int | None = None
        self._dead_from: int | None = None
        self._lost_at: int | None = None

    def run(self) -> NoReturn:
        """Raises ReaderGone, Crashed; Refusal where the bus never came up."""
        attempt = hung = 0
        while True:
            if not self._first:
                self._await_answers()
            begun_s = time.monotonic()
            end = self._live(SILENCE_S[min(hung, len(SILENCE_S) - 1)])
            hung += end.hung
            if end.ran:
                self._first, hung = False, 0
                self._report_loss(end.reason)
                self.number += 1
                if time.monotonic() - begun_s > LONG_S:
                    attempt = 0
                    continue  # at once: most losses are short
            if self._first and end.refusal is not None:
                if end.refusal.code not in _WORTH_A_TRY or attempt == _FIRST_TRIES - 1:
                    raise end.refusal
            else:
                self.wire.check(PAUSES_S[min(attempt, len(PAUSES_S) - 1)])
            attempt += 1

    def _await_answers(self) -> None:
        asked = 0
        while True:
            self._still_dead()
            with contextlib.suppress(Refusal, OSError):  # the loss has been reported, and the next try comes
                preflight.check_interface(self.interface)
                # SOEM takes many seconds to give up on a line that is dead or slow; two frames show it sooner.
                if all(count_slaves(self.interface, PROMPT_ANSWER_S, (2 * asked + k) % 128) for k in (0, 1)):
                    return
            self.wire.check(PROBE_PAUSES_S[min(asked, len(PROBE_PAUSES_S) - 1)])
            asked += 1

    # --- one life ---------------------------------------------------------------------------------------------

    def _live(self, silence_s: float) -> End:
        child = _Child(lambda wire: self._life(self.number, wire))
        ready = False
        try:
            heard_s = time.monotonic()
            while True:
                if self.wire.wait(child.out, POLL_S):
                    heard_s = time.monotonic()
                    lines = child.lines()
                    if lines is None:
                        raise Crashed
                    for line in lines:
                        content = json.loads(line, object_hook=unpacked)
                        ready = ready or content["m"] == "ready"
                        end = self._take(content, line)
                        if end is not None:
                            return end
                elif ready and time.monotonic() - heard_s > STUCK_S:
                    child.kill()
                    self._dead_from = self._until
                    return End(True, message("the process that runs the bus stands still"))
                elif not ready and time.monotonic() - heard_s > silence_s:
                    child.kill()
                    words = message(
                        "the EtherCAT devices on {name} do not get ready: answers come late or get lost",
                        name=self.interface,
                    )
                    remedy = message("close programs that keep this computer busy, check the cable and the supply")
                    return End(False, refusal=Refusal("unsteady", words, remedy), hung=True)
                if not ready and not self._first:
                    self._still_dead()
        finally:
            child.end()

    def _take(self, content: dict[str, Any], line: bytes) -> End | None:
        kind = content["m"]
        if kind == "over":
            if content["dead_from"] is not None:
                self._dead_from, self._level = content["dead_from"], content["level"]
            return End(True, content["reason"])
        if kind == "failed":
            return End(False, refusal=Refusal(content["code"], content["problem"], content["remedy"]))
        if kind == "up":
            return None
        self.wire.pass_on(line)
        if kind in ("tick", "edges"):
            self._until, self._level = content["until"], content.get("level", self._level)
        if kind == "ready":
            self._until = content["since"]
            self._report_return(content["since"], content["level"])
        return None

    # --- words ------------------------------------------------------------------------------------------------

    def _report_return(self, since: int, level: int) -> None:
        if self._dead_from is not None:
            # A level that changed meanwhile proves one lost edge; more may be missing.
            missed = int(self._level is not None and level != self._level)
            self.wire.send("gap", start=self._dead_from, end=since, missed=missed)
            away_s = (since - (self._lost_at or self._dead_from)) / 1e9
            words = message(
                "The laser sensor is back after {seconds:.2f} s and records again; edges in between may be missing.",
                seconds=away_s,
            )
            self._notice("info", words, "back")
        self._dead_from = self._lost_at = None
        self._level = level

    def _still_dead(self) -> None:
        now = time.monotonic_ns()
        if self._dead_from is not None and now - self._dead_from > DEAD_GAP_NS:
            self.wire.send("gap", start=self._dead_from, end=now, missed=0)
            self._dead_from = now
        self.wire.send("tick", until=now if self._dead_from is None else self._dead_from, alive=False)

    def _report_loss(self, reason: str) -> None:
        if self._dead_from is None:
            self._dead_from = time.monotonic_ns()
        if self._lost_at is None:
            self._lost_at = self._dead_from
            reason = preflight.link_trouble(self.interface) or reason
            self._notice(
                "error",
                message("The laser sensor is lost: {why}. draglag tries to bring it back.", why=phrase(reason)),
                "lost",
            )

    def _notice(self, level: str, text: str, state: str) -> None:
        self.wire.send("notice", t=time.monotonic_ns(), level=level, text=text, state=state)


class _Child:
    """A fork that ends when its input closes, or its parent ends."""

    def __init__(self, run: Callable[[Wire], None]) -> None:
        ours_in, its_out = os.pipe()
        its_in, ours_out = os.pipe()
        parent = os.getpid()
        self._pid = os.fork()
        if self._pid == 0:
            os.close(ours_in)
            os.close(ours_out)
            _run(run, its_in, its_out, parent)
        os.close(its_in)
        os.close(its_out)
        self.out, self._in, self._rest, self._alive = ours_in, ours_out, b"", True

    def lines(self) -> list[bytes] | None:
        received = os.read(self.out, 1 << 16)
        if not received:
            return None
        *lines, self._rest = (self._rest + received).split(b"\n")
        return lines

    def kill(self) -> None:
        with contextlib.suppress(ProcessLookupError):
            os.kill(self._pid, signal.SIGKILL)

    def end(self) -> None:
        if not self._alive:
            return
        self._alive = False
        os.close(self._in)
        until = time.monotonic() + EXIT_S
        while os.waitpid(self._pid, os.WNOHANG)[0] == 0:
            if time.monotonic() > until:
                self.kill()
                os.waitpid(self._pid, 0)
                break
            time.sleep(0.001)
        os.close(self.out)


def _run(run: Callable[[Wire], None], inlet: int, out: int, parent: int) -> NoReturn:
    code = 1
    try:
        # However the parent ends: a child that SOEM holds must not keep the interface.
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() == parent:
            wire = Wire(inlet, out)
            run(wire)
            wire.drain()
        code = 0
    except ReaderGone:
        code = 0
    except BaseException:
        import traceback

        traceback.print_exc()
    finally:
        os._exit(code)
