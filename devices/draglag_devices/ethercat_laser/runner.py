"""Runs the bus from set-up until lost."""

from __future__ import annotations

import time
from collections import Counter
from typing import NoReturn

import pysoem

from draglag.errors import message_of
from draglag.messages import message
from draglag_devices.ethercat_laser.bus import Bus
from draglag_devices.ethercat_laser.refusal import Refusal
from draglag_devices.ethercat_laser.waits import (
    CLOCK_EVERY_NS,
    CYCLE_NS,
    DELAYED_NS,
    STATE_EVERY_NS,
    SUMMARY_EVERY_NS,
    TICK_EVERY_NS,
)
from draglag_devices.ethercat_laser.watch import BAD_CYCLES, WORDS, Epoch, Found
from draglag_devices.ethercat_laser.wire import Wire

# First cycles of an epoch: only for the narrowest clock pair, and for the latches to be up to date.
_BASELINE_CYCLES = 20
_BASELINE_TRIES = 200
# What the terminal's clock may differ from the bus's: the design warns above 1 ms.
_DIVERGENCE_NS = 1_000_000


class Restart(Exception):
    """The epoch is over."""


def live(interface: str, channel: int, position: int, number: int, wire: Wire) -> None:
    """Run the bus until lost: messages "up" during set-up, ``Runner``'s, then "over" or "failed". Raises ReaderGone."""
    try:
        bus = Bus(interface, position, lambda: wire.send("up"))
    except Refusal as refusal:
        wire.send("failed", code=refusal.code, problem=refusal.problem, remedy=refusal.remedy)
        return
    runner = Runner(channel, number, wire)
    try:
        runner.run(bus)
    except Restart as reason:
        wire.send("over", reason=message_of(reason), dead_from=runner.dead_from, level=runner.level)
    finally:
        bus.close()


class Runner:
    """One epoch. ``dead_from``: host time up to which all edges are known, ns; ``level``: the last."""

    def __init__(self, channel: int, number: int, wire: Wire) -> None:
        self.channel, self.number, self.wire = channel, number, wire
        self.dead_from: int | None = None
        self.level: int | None = None
        self._sound_ns = 0  # when the devices last said that all is well
        self._failed_checks = 0
        self._reported: Counter[str] = Counter()
        self._divergence_reported = False
        self._summed_ns = time.monotonic_ns()

    def run(self, bus: Bus) -> NoReturn:
        """Raises Restart when the bus is lost, ReaderGone."""
        epoch = Epoch(self.number, self.channel, bus.expected_wkc)
        self._begin(bus, epoch)
        self._summed_ns = time.monotonic_ns()
        try:
            self._cycles(bus, epoch)
        finally:
            self._summarise(epoch)

    def _cycles(self, bus: Bus, epoch: Epoch) -> NoReturn:
        next_ns = time.monotonic_ns()
        state_ns, clock_ns = next_ns + STATE_EVERY_NS, next_ns + CLOCK_EVERY_NS
        tick_ns, summary_ns = next_ns, next_ns + SUMMARY_EVERY_NS
        self._failed_checks = 0
        while True:
            found = epoch.take(bus.cycle())
            now = time.monotonic_ns()
            self.dead_from = epoch.good_ns
            if found is not None:
                self._send_found(found, epoch)
            elif epoch.bad >= BAD_CYCLES:
                raise Restart(WORDS[epoch.why])
            if now >= tick_ns:
                self.wire.check()
                self.wire.send("tick", until=epoch.good_ns, alive=True)
                tick_ns = now + TICK_EVERY_NS
            if now >= clock_ns:
                self._report_clock(epoch)
                clock_ns = now + CLOCK_EVERY_NS
            # Where cycles fail already, they are more informative than a question about the state.
            if now >= state_ns and not epoch.bad:
                state_ns = now + (STATE_EVERY_NS if self._check_state(bus, now) else 0)
            if now >= summary_ns:
                self._summarise(epoch)
                if not epoch.bad:
                    self._check_terminal_clock(bus, epoch)
                summary_ns = now + SUMMARY_EVERY_NS
            next_ns = _wait_for_cycle(next_ns + CYCLE_NS)

    def _send_found(self, found: Found, epoch: Epoch) -> None:
        if found.unverified_ns is not None:
            start, end = found.unverified_ns
            self.wire.send("gap", start=start, end=end, missed=0)
        self.level = epoch.edges.level if epoch.edges is not None else None
        if found.edges or found.missed:
            edges = {"edges": found.edges, "missed": found.missed, "level": self.level}
            self.wire.send("edges", epoch=epoch.number, until=epoch.good_ns, **edges)
        if found.missed:
            words = message(
                "{n} edge of the laser came too fast to be stamped."
                if found.missed == 1
                else "{n} edges of the laser came too fast to be stamped.",
                n=found.missed,
            )
            self._notice("warning", words)

    def _check_state(self, bus: Bus, now_ns: int) -> bool:
        trouble = self._trouble(bus)
        self._failed_checks = self._failed_checks + 1 if trouble else 0
        if self._failed_checks >= 2:
            self.dead_from = self._sound_ns
            raise Restart(trouble)
        if not trouble:
            self._sound_ns = now_ns
        return not trouble

    def _begin(self, bus: Bus, epoch: Epoch) -> None:
        self._sound_ns = time.monotonic_ns()  # mapping and latch unit were read back just now
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
        if epoch.last is None or epoch.edges is None:
            raise Restart(message("the EL1252 came up but gives no valid data"))
        self.dead_from, self.level = epoch.good_ns, epoch.edges.level
        content = {"epoch": epoch.number, "slaves": bus.describe(), "expected_wkc": bus.expected_wkc}
        # What happened before the answer came may be in the baseline: the edges that count come after ``since``.
        self.wire.send(
            "ready", dc=epoch.good_dc_ns, level=self.level, since=epoch.last.high_ns, position=bus.position, **content
        )
        self._report_clock(epoch)

    def _check_terminal_clock(self, bus: Bus, epoch: Epoch) -> None:
        if self._divergence_reported:
            return
        try:
            offset_ns = epoch.clock.offset_ns(bus.terminal_clock())
        except pysoem.WkcError:
            return  # the cycles report it
        if offset_ns > _DIVERGENCE_NS:
            self._divergence_reported = True
            self._notice(
                "error",
                message(
                    "The EL1252's clock does not follow the bus's: it is {ms:.1f} ms off, and so are its edges. Switch "
                    "the supply of the coupler off and on.",
                    ms=offset_ns / 1e6,
                ),
            )

    def _trouble(self, bus: Bus) -> str:
        try:
            if not bus.in_operation():
                return bus.state_trouble()
            return "" if bus.latching() else message("another program switched the EL1252's latch unit off")
        except pysoem.WkcError:
            return message("the EL1252 does not answer questions about its state")

    # --- words ------------------------------------------------------------------------------------------------

    def _notice(self, level: str, text: str) -> None:
        self.wire.send("notice", t=time.monotonic_ns(), level=level, text=text)

    def _report_clock(self, epoch: Epoch) -> None:
        best = epoch.clock.take_best()
        if best is not None:
            self.wire.send("clock", epoch=epoch.number, dc=best.dc_ns, low=best.low_ns, high=best.high_ns)

    def _summarise(self, epoch: Epoch) -> None:
        pauses_ns, epoch.pauses_ns = epoch.pauses_ns, []
        counts, self._reported = epoch.counts - self._reported, Counter(epoch.counts)
        since, self._summed_ns = self._summed_ns, time.monotonic_ns()
        cycles, epoch.cycles = epoch.cycles, 0
        self.wire.send("cycles", since=since, t=self._summed_ns, cycles=cycles, refused=dict(counts))
        if pauses_ns and max(pauses_ns) > DELAYED_NS:
            self._notice(
                "warning",
                message(
                    "The laser was not read for {ms:.0f} ms: this computer was busy or the bus did not answer. Where "
                    "edges may be missing is marked.",
                    ms=max(pauses_ns) / 1e6,
                ),
            )


def _wait_for_cycle(next_ns: int) -> int:
    wait_ns = next_ns - time.monotonic_ns()
    if wait_ns > 0:
        time.sleep(wait_ns / 1e9)
    return next_ns if wait_ns >= -5 * CYCLE_NS else time.monotonic_ns()
