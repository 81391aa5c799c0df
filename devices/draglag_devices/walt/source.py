"""A WALT as a source."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable

import numpy as np

from draglag.errors import message_of
from draglag.instruments.clocks import LARGEST_DRIFT
from draglag.messages import message
from draglag.recording import LaserTrace, Taps, concatenate
from draglag_devices.addresses import Address
from draglag_devices.clockmap import OnlineClockMap
from draglag_devices.source import Batch, DeviceError, Notice, SourceInfo
from draglag_devices.walt.connect import greet
from draglag_devices.walt.connection import Connection
from draglag_devices.walt.edges import counted_so_far
from draglag_devices.walt.link import Answer, Link, NoAnswer
from draglag_devices.walt.port import Port, PortGone, SerialPort, port_of, usb_identity
from draglag_devices.walt.protocol import LASER_OFF, LASER_ON, RESET, SHOCK, Unwrapped, parse_shock
from draglag_devices.walt.sync import Bound, as_bounds, compare, request_time, zero

# Quick comparison of clocks; it also keeps the 32-bit count unwrapped and notices a device that hangs.
TIME_EVERY_S = 1.0
# Full comparison when nothing has happened for a while, that is before, between and after blocks.
FULL_EVERY_S = 10.0
QUIET_S = 3.0
POLL_EVERY_S = 0.02
# A tap rings on; shocks this soon after the last one are the same one.
RINGING_S = 0.05
# Edges may still be on their way from the device.
IN_FLIGHT_S = 0.02
# A stamp this far in the future was damaged on the wire.
FUTURE_S = 0.05
# So was a time this far from where the clock should be; several in a row mean that the clock restarted.
CONTRADICTION_S = 1e-3
RESTART_AFTER = 3
RETRY_S = 0.5
GAP_EVERY_S = 1.0


class WaltSource:
    """Role "walt": shocks, polled; role "laser": edges of its own laser.

    A lost WALT is searched for; its clock then begins a new epoch.
    """

    realtime = True

    def __init__(
        self,
        address: Address,
        role: str,
        open_port: Callable[[str], Port] = SerialPort,
        now: Callable[[], float] = time.monotonic,
        pause: Callable[[float], None] = time.sleep,
    ) -> None:
        self.address = address.text
        self.role = role
        self._path = address.target
        self._any_firmware = address.choice("firmware", ("known", "any"), "known") == "any"
        self._open_port, self._now, self._pause = open_port, now, pause
        self._device: Connection | None = None
        self._identity: tuple[int, int, str] | None = None
        self._epoch = -1
        self._notices: list[Notice] = []
        self._until_s = 0.0
        self._last_time_s = self._last_full_s = self._last_event_s = -np.inf
        self._next_poll_s = 0.0
        self._next_try_s = 0.0
        self._last_shock_s = -np.inf
        self._pending_shocks: list[Taps] = []  # shocks reported while clocks were compared
        self._asked: deque[threading.Event] = deque()  # filled by other threads
        self._compared: list[threading.Event] = []

    def synchronise(self) -> threading.Event:
        """As ``Synchronises``; takes about 0.15 s."""
        done = threading.Event()
        self._asked.append(done)
        return done

    def _take_requests(self) -> list[threading.Event]:
        return [self._asked.popleft() for _ in range(len(self._asked))]

    def open(self) -> SourceInfo:
        self._device = device = self._connect()
        self._until_s = self._now()
        return SourceInfo(
            self.address,
            self.role,
            message(
                "WALT, firmware {version}, its own laser" if self.role == "laser" else "WALT, firmware {version}, taps",
                version=device.version,
            ),
            message("WALT's microseconds, compared with the host's by bounds"),
            {"firmware": device.version, "clock_width_us": round(1e6 * device.best_width_s, 1)},
        )

    def read(self, timeout_s: float) -> Batch:
        device = self._device
        if device is None:
            return self._while_lost(timeout_s)
        laser: LaserTrace | None = None
        taps: Taps | None = None
        try:
            self._keep_clock(device)
            if self.role == "laser":
                laser = self._read_laser(device, timeout_s)
                until_s = self._now() - IN_FLIGHT_S
            else:
                polled, until_s = self._poll_shock(device, 0.0 if self._pending_shocks else timeout_s)
                taps = self._felt(polled)
        except (PortGone, NoAnswer) as fault:
            return self._lose(fault)
        self._report_unread(device)
        self._until_s = max(self._until_s, until_s)
        return self._batch(device, laser, taps)

    def close(self) -> None:
        device, self._device = self._device, None
        if device is None:
            return
        try:
            if self.role == "laser":
                device.link.send(LASER_OFF)
        except PortGone:
            pass  # it is gone already
        device.link.close()

    @property
    def link(self) -> Link:
        """The open conversation, for set-up. Raises DeviceError."""
        if self._device is None:
            raise DeviceError(self.address, "the WALT is not connected", "plug it in")
        return self._device.link

    # --- connection -------------------------------------------------------------------------------------------

    def _connect(self) -> Connection:
        self._path = port_of(self._identity, self._path)
        link = Link(self._open_port(self._path), self._now, self._pause)
        self._identity = self._identity or usb_identity(self._path)
        try:
            version = greet(link, self.address, self._any_firmware)
            self._epoch += 1
            device = Connection(link, version, self._epoch)
            self._zero(device)
            if self.role == "laser":
                # Edges while the clocks were compared are no edges of ours; some firmware forgets them when asked for
                # the last one and some does not, so they are forgotten here.
                link.acknowledged(RESET)
                link.acknowledged(LASER_ON)
                device.edges = counted_so_far(link)
            else:
                link.ask(SHOCK, parse_shock, late=True)  # arms the trigger; what it felt before is of no interest
        except (NoAnswer, PortGone) as fault:
            link.close()
            raise DeviceError(
                self.address,
                message(
                    "the WALT does not answer as it should ({why})"
                    if str(fault)
                    else "the WALT does not answer as it should",
                    why=message_of(fault),
                ),
                "unplug it and plug it in again",
            ) from None
        except DeviceError:
            link.close()
            raise
        self._next_poll_s = self._now()
        return device

    def _zero(self, device: Connection) -> None:
        first = zero(device.link)
        device.learn([first])
        rows = compare(device.link, device.unwrapped, first)
        if not rows:
            raise NoAnswer
        device.learn(rows)
        self._last_time_s = self._last_full_s = self._now()

    def _lose(self, fault: Exception) -> Batch:
        device, self._device = self._device, None
        if device is not None:
            device.link.close()
        now_s = self._now()
        self._next_try_s = now_s + RETRY_S
        text = message(
            "The WALT at {path} is gone ({why}). Plug it in again; it goes on then."
            if str(fault)
            else "The WALT at {path} is gone. Plug it in again; it goes on then.",
            path=self._path,
            why=message_of(fault),
        )
        self._notices.append(Notice(now_s, "error", text, "lost"))
        return self._batch(device, None, self._felt(None), alive=False)

    def _while_lost(self, timeout_s: float) -> Batch:
        now_s = self._now()
        if now_s < self._next_try_s:
            self._pause(min(timeout_s, self._next_try_s - now_s))
        if self._now() >= self._next_try_s:
            self._next_try_s = self._now() + RETRY_S
            try:
                self._device = self._connect()
            except DeviceError:
                self._device = None  # not back yet
        now_s, back = self._now(), self._device is not None
        laser: LaserTrace | None = None
        if back:
            text = message("The WALT at {path} is back and records again; its clock began at 0.", path=self._path)
            self._notices.append(Notice(now_s, "info", text, "back"))
        if back or now_s - self._until_s >= GAP_EVERY_S:
            if self.role == "laser":
                laser = LaserTrace(np.empty(0), np.empty(0, np.int64), gaps_s=np.array([[self._until_s, now_s]]))
            self._until_s = now_s
        return self._batch(self._device, laser, None, alive=back)

    # --- clock ------------------------------------------------------------------------------------------------

    def _keep_clock(self, device: Connection) -> None:
        now_s = self._now()
        asked = self._take_requests()
        if now_s - self._last_time_s < TIME_EVERY_S and not asked:
            return
        self._compared += asked
        self._last_time_s = now_s
        bound = self._time(device)
        if bound is None:
            return
        device.learn([bound])
        quiet = now_s - self._last_event_s >= QUIET_S
        if asked or (quiet and now_s - self._last_full_s >= FULL_EVERY_S):
            self._last_full_s = now_s
            device.learn(compare(device.link, device.unwrapped, bound, between=lambda: self._collect_shocks(device)))

    def _time(self, device: Connection) -> Bound | None:
        try:
            bound = request_time(device.link, device.unwrapped)
        except NoAnswer:
            # The conversation was brought back in step, or ``settle`` raised and the device is lost.
            device.link.settle()
            return None
        expected_s = device.host_s(bound.device_s)
        # After a long silence (a suspended computer) drift alone explains more.
        slack_s = CONTRADICTION_S + LARGEST_DRIFT * (bound.host_max_s - device.learnt_s)
        if bound.host_min_s - slack_s <= expected_s <= bound.host_max_s + slack_s:
            device.contradictions = 0
            return bound
        device.contradictions += 1
        if device.contradictions >= RESTART_AFTER:
            self._restart_clock(device)
        return None

    def _restart_clock(self, device: Connection) -> None:
        self._notices.append(
            Notice(
                self._now(), "warning", message("The WALT's clock jumped; it was set and compared again from here on.")
            )
        )
        self._epoch += 1
        device.epoch, device.contradictions = self._epoch, 0
        device.unwrapped, device.clock_map = Unwrapped(), OnlineClockMap()
        self._zero(device)

    # --- samples ----------------------------------------------------------------------------------------------

    def _read_laser(self, device: Connection, timeout_s: float) -> LaserTrace | None:
        device.link.listen(timeout_s)
        triggers = [trigger for trigger in device.link.take_triggers() if trigger.tag == "L"]
        if not triggers:
            return None
        now_s = self._now()
        self._last_event_s = now_s
        seen = device.edges.take(
            [(device.unwrapped(trigger.us), trigger.value, trigger.count) for trigger in triggers],
            device.host_s,
            (self._until_s - 1.0, now_s + FUTURE_S),
            device.epoch,
        )
        if seen.missed:
            words = message(
                "{n} edge of the laser was lost by the WALT; the gap is marked."
                if seen.missed == 1
                else "{n} edges of the laser were lost by the WALT; the gap is marked.",
                n=seen.missed,
            )
            self._notices.append(Notice(now_s, "warning", words))
        return seen

    def _poll_shock(self, device: Connection, timeout_s: float) -> tuple[Taps | None, float]:
        wait_s = min(timeout_s, self._next_poll_s - self._now())
        if wait_s > 0:
            device.link.listen(wait_s)
        if self._now() < self._next_poll_s:
            return None, self._until_s
        return self._ask_shock(device)

    def _collect_shocks(self, device: Connection) -> None:
        """Keep the present shock: the WALT holds one until asked, and a quick tap has two within a full comparison."""
        if self.role == "walt":
            taps, _ = self._ask_shock(device)
            if taps is not None:
                self._pending_shocks.append(taps)

    def _felt(self, polled: Taps | None) -> Taps | None:
        felt, self._pending_shocks = [*self._pending_shocks, *([] if polled is None else [polled])], []
        return concatenate(felt) if felt else None

    def _ask_shock(self, device: Connection) -> tuple[Taps | None, float]:
        asked_s = self._now()
        self._next_poll_s = asked_s + POLL_EVERY_S
        try:
            # Asking re-arms the WALT, which has forgotten the shock then: a late answer counts.
            answer = device.link.ask(SHOCK, parse_shock, late=True)
        except NoAnswer:
            # It may still come when even the ping after it was not answered in time.
            found = device.link.settle(parse_shock)
            if found is None:
                return _rejected("unreadable"), self._until_s
            answer = Answer(found[0], asked_s, found[1])
        if answer.value == 0:
            return None, answer.sent_s
        host_s = device.host_s(device.unwrapped(answer.value))
        if not answer.sent_s - 3600.0 < host_s < answer.arrived_s + FUTURE_S:
            return _rejected("unreadable"), answer.sent_s
        if host_s < self._until_s - QUIET_S:
            return _rejected("stale"), answer.sent_s
        self._last_event_s = answer.arrived_s
        if host_s - self._last_shock_s < RINGING_S:
            return _rejected("ringing"), answer.sent_s
        self._last_shock_s = host_s
        # The WALT keeps the first shock after a question: before this one there was none, however late it was asked.
        until_s = max(answer.sent_s, min(host_s, answer.arrived_s))
        return Taps(np.array([host_s]), np.array([np.nan]), np.array([-1], np.int64)), until_s

    # --- handing on -------------------------------------------------------------------------------------------

    def _report_unread(self, device: Connection) -> None:
        new = device.link.unread - device.unread
        if new:
            device.unread = device.link.unread
            words = message(
                "{n} line from the WALT could not be read."
                if new == 1
                else "{n} lines from the WALT could not be read.",
                n=new,
            )
            self._notices.append(Notice(self._now(), "warning", words))

    def _batch(
        self, device: Connection | None, laser: LaserTrace | None, taps: Taps | None, alive: bool = True
    ) -> Batch:
        notices, self._notices = tuple(self._notices), []
        clock = None
        if device is not None and device.rows:
            rows, device.rows = device.rows, []
            clock = as_bounds(self.role, rows, device.epoch)
        compared, self._compared = self._compared, []
        if device is None:  # there is nothing to compare with
            compared += self._take_requests()
        for done in compared:
            done.set()
        return Batch(self._until_s, laser=laser, taps=taps, clock=clock, notices=notices, alive=alive)


def _rejected(reason: str) -> Taps:
    return Taps(np.empty(0), np.empty(0), np.empty(0, np.int64), {reason: 1})
