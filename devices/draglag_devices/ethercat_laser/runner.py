"""Cycles at 1 kHz, epoch after epoch: what is seen goes out on the wire, and a lost bus is brought back."""

from __future__ import annotations

import time
from collections import Counter

import pysoem

from draglag_devices.ethercat_laser import preflight
from draglag_devices.ethercat_laser.bus import Bus
from draglag_devices.ethercat_laser.probe import count_slaves
from draglag_devices.ethercat_laser.refusal import Refusal
from draglag_devices.ethercat_laser.watch import BAD_CYCLES, WORDS, Epoch
from draglag_devices.ethercat_laser.wire import Wire

CYCLE_NS = 1_000_000
_STATE_NS, _CLOCK_NS, _TICK_NS, _SUMMARY_NS = 100_000_000, 250_000_000, 10_000_000, 1_000_000_000
# First cycles of an epoch: only for the narrowest clock pair, and for the latches to be up to date.
_BASELINE_CYCLES = 20
_BASELINE_TRIES = 200
_FIRST_TRIES = 5
_PAUSES_S = (0.01, 0.01, 0.02, 0.02, 0.05, 0.05, 0.1, 0.1, 0.2, 0.2, 0.5)
_PROMPT_S = 0.005
# The latches keep the last edge of each direction: a short blackout loses none, a longer one may.
_BLACKOUT_NS = 20_000_000
_DEAD_GAP_NS = 1_000_000_000
# What the terminal's clock may differ from the bus's: the design warns above 1 ms.
_APART_NS = 1_000_000


class Restart(Exception):
    """The epoch is over; the message says why."""


class Runner:
    """Epoch after epoch until the reader goes."""

    def __init__(self, interface: str, channel: int, wire: Wire, first_epoch: int = 0) -> None:
        self.interface, self.channel, self.wire = interface, channel, wire
        self.number = first_epoch
        self._dead_from: int | None = None
        self._lost_at: int | None = None
        self._level: int | None = None
        self._recovering = False
        self._apart_in: int | None = None  # epoch in which it was told that clocks go apart
        self._sound_ns = 0  # when the devices last said that all is well
        self._told: Counter[str] = Counter()

    def run(self, bus: Bus) -> None:
        """From a bus that was just brought up. Raises ReaderGone."""
        while True:
            try:
                self._epoch(bus)
            except Restart as reason:
                self._tell_loss(str(reason))
            finally:
                bus.close()
            self.number += 1
            bus = self.bring_back()

    # --- one epoch --------------------------------------------------------------------------------------------

    def _epoch(self, bus: Bus) -> None:
        epoch = Epoch(self.number, self.channel, bus.expected_wkc)
        self._begin(bus, epoch)
        try:
            self._cycles(bus, epoch)
        finally:
            self._summarise(epoch.counts - self._told)

    def _cycles(self, bus: Bus, epoch: Epoch) -> None:
        next_ns = time.monotonic_ns()
        state_ns, clock_ns = next_ns + _STATE_NS, next_ns + _CLOCK_NS
        tick_ns, summary_ns = next_ns, next_ns + _SUMMARY_NS
        doubts = 0
        while True:
            good_before = epoch.good_ns or 0
            found = epoch.take(bus.cycle())
            now = time.monotonic_ns()
            if found is not None:
                edges, missed = found
                good = epoch.good_ns or 0
                if self._recovering and good - good_before > _BLACKOUT_NS:
                    self.wire.tell("gap", start=good_before, end=good, missed=0)
                self._recovering = False
                self._level = epoch.edges.level if epoch.edges is not None else None
                if edges or missed:
                    self.wire.tell("edges", epoch=epoch.number, edges=edges, missed=missed, until=good)
                if missed:
                    self._notice("warning", f"{_count(missed, 'edge')} of the laser came too fast to be stamped.")
            else:
                self._recovering = True
                self._dead_from = epoch.good_ns
                if epoch.bad >= BAD_CYCLES:
                    raise Restart(WORDS[epoch.why])
            if now >= tick_ns:
                self.wire.check()
                self.wire.tell("tick", until=epoch.good_ns, alive=True)
                tick_ns = now + _TICK_NS
            if now >= clock_ns:
                self._tell_clock(epoch)
                clock_ns = now + _CLOCK_NS
            # Where cycles fail already, they say more than a question about the state would.
            if now >= state_ns and not epoch.bad:
                trouble = self._trouble(bus)
                doubts = doubts + 1 if trouble else 0
                if doubts >= 2:
                    self._dead_from = self._sound_ns
                    raise Restart(trouble)
                if not trouble:
                    self._sound_ns = now
                state_ns = now + (0 if trouble else _STATE_NS)
            if now >= summary_ns:
                self._summarise(epoch.counts - self._told)
                if not epoch.bad:
                    self._check_terminal_clock(bus, epoch)
                self._told, summary_ns = Counter(epoch.counts), now + _SUMMARY_NS
            next_ns += CYCLE_NS
            wait_ns = next_ns - time.monotonic_ns()
            if wait_ns > 0:
                time.sleep(wait_ns / 1e9)
            elif wait_ns < -5 * CYCLE_NS:
                next_ns = time.monotonic_ns()

    def _begin(self, bus: Bus, epoch: Epoch) -> None:
        """The baseline: clock pairs first, then the first values of the latches. Raises Restart."""
        self._recovering = False
        self._sound_ns = time.monotonic_ns()  # mapping and latch unit were read back just now
        self._told = Counter()
        good = 0
        for _ in range(_BASELINE_TRIES):
            cycle = bus.cycle()
            if cycle.wkc == bus.expected_wkc and epoch.clock.fits(cycle.pair):
                good += 1
                if good < _BASELINE_CYCLES:
                    epoch.clock.add(cycle.pair)
                elif epoch.take(cycle) is not None:
                    break
            self.wire.check()
            time.sleep(CYCLE_NS / 1e9)
        if epoch.good_ns is None or epoch.edges is None:
            raise Restart("the EL1252 came up but gives no valid data")
        level = epoch.edges.level
        content = {"epoch": epoch.number, "slaves": bus.describe(), "expected_wkc": bus.expected_wkc}
        self.wire.tell("ready", dc=epoch.good_dc_ns, level=level, **content)
        self._tell_clock(epoch)
        if self._dead_from is not None:
            # A level that changed meanwhile proves one lost edge; more may be missing.
            missed = int(self._level is not None and level != self._level)
            self.wire.tell("gap", start=self._dead_from, end=epoch.good_ns, missed=missed)
            away_s = (epoch.good_ns - (self._lost_at or self._dead_from)) / 1e9
            self._notice("info", f"The laser sensor is back after {away_s:.2f} s; edges in between may be missing.")
        self._dead_from = self._lost_at = None
        self._level = level

    def _check_terminal_clock(self, bus: Bus, epoch: Epoch) -> None:
        """Stamps are the terminal's, comparisons the bus's: told once when the two clocks go apart."""
        if epoch.number == self._apart_in:
            return
        try:
            apart_ns = epoch.clock.apart_ns(bus.terminal_clock())
        except pysoem.WkcError:
            return  # the cycles tell
        if apart_ns > _APART_NS:
            self._apart_in = epoch.number
            self._notice(
                "error", f"The EL1252's clock does not follow the bus's: it is {apart_ns / 1e6:.1f} ms off, and so are "
                "its edges. Switch the supply of the coupler off and on.",
            )  # fmt: skip

    def _trouble(self, bus: Bus) -> str:
        """Why the devices are not in operation, or an empty string; costs one or two frames."""
        try:
            if not bus.in_operation():
                return str(bus.state_trouble())
            return "" if bus.latching() else "another program switched the EL1252's latch unit off"
        except pysoem.WkcError:
            return "the EL1252 does not answer questions about its state"

    # --- between epochs ---------------------------------------------------------------------------------------

    def bring_back(self) -> Bus:
        """Close, open, everything, with growing pauses. Raises ReaderGone."""
        attempt = 0
        while True:
            self._still_dead()
            try:
                preflight.check_interface(self.interface)
                # SOEM may take many seconds to give up on a line that is dead or slow; two frames tell sooner.
                if all(count_slaves(self.interface, _PROMPT_S, (2 * attempt + k) % 128) for k in (0, 1)):
                    return Bus(self.interface)
            except (Refusal, OSError):
                pass  # not this time either: the loss has been told, and the next try comes
            self.wire.check(_PAUSES_S[min(attempt, len(_PAUSES_S) - 1)])
            attempt += 1

    def _still_dead(self) -> None:
        now = time.monotonic_ns()
        if self._dead_from is not None and now - self._dead_from > _DEAD_GAP_NS:
            self.wire.tell("gap", start=self._dead_from, end=now, missed=0)
            self._dead_from = now
        self.wire.tell("tick", until=now if self._dead_from is None else self._dead_from, alive=False)

    def _tell_loss(self, reason: str) -> None:
        now = time.monotonic_ns()
        if self._dead_from is None:
            self._dead_from = now
        if self._lost_at is None:
            self._lost_at = self._dead_from
            if not preflight.carrier_now(self.interface):
                reason = f"the cable on {self.interface} is unplugged or the other end is off"
            self._notice("error", f"The laser sensor is lost: {reason}. draglag tries to bring it back.")

    # --- words ------------------------------------------------------------------------------------------------

    def _notice(self, level: str, text: str) -> None:
        self.wire.tell("notice", t=time.monotonic_ns(), level=level, text=text)

    def _tell_clock(self, epoch: Epoch) -> None:
        best = epoch.clock.take_best()
        if best is not None:
            self.wire.tell("clock", epoch=epoch.number, dc=best.dc_ns, low=best.low_ns, high=best.high_ns)

    def _summarise(self, counts: Counter[str]) -> None:
        """Refused cycles of the last second, by reason: every one is accounted for."""
        if not counts:
            return
        words = {"lost": "without an answer", "counter": "without the EL1252", "stale": "with old data",
                 "stamp": "with impossible stamps"}  # fmt: skip
        parts = ", ".join(f"{n} {words[reason]}" for reason, n in sorted(counts.items()))
        self._notice("warning", f"Disturbed EtherCAT cycles in the last second: {parts}.")
        self.wire.tell("disturbed", **counts)


def _count(n: int, noun: str) -> str:
    return f"{n} {noun}" + ("" if n == 1 else "s")


def first_bus(interface: str) -> Bus:
    """The bus, tried again where lost frames may be to blame. Raises Refusal."""
    for _ in range(_FIRST_TRIES - 1):
        try:
            return Bus(interface)
        except Refusal as refusal:
            if refusal.code not in ("unsteady", "state"):
                raise
    return Bus(interface)
