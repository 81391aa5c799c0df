"""The segment as a lab would see it: slaves in a row, and what can go wrong with them."""

from __future__ import annotations

import heapq
import random
from collections import Counter, deque
from typing import Any

from .esc import ERROR, SAFE_OP, Esc
from .frames import BWR, answer, asks_for_station, is_process_data, with_index
from .terminals import EK1100, EK1101, EL1252, ek1100, ek1101, el1252, other_terminal

Order = dict[str, Any]
# A master at 1 kHz that is later than this was held up.
PAUSE_NS = 1_400_000


class Line:
    """EK1101 and EL1252 on a line, with faults on demand. All times are ns of the host's CLOCK_MONOTONIC."""

    def __init__(self, t_ns: int, drifts: tuple[float, float] = (12e-6, -20e-6), seed: int = 1) -> None:
        self._seed = seed
        self._drifts = drifts
        self.build(t_ns, EK1101, EL1252)

    def build(
        self,
        t_ns: int,
        coupler: int,
        terminal: int,
        behind: tuple[int, ...] = (),
        clock: bool = True,
        in_bytes: bool = False,
        slow_ns: int = 0,
        before: tuple[int, ...] = (),
    ) -> None:
        """Make new slaves of these product codes; faults are forgotten.

        Args:
            behind, before: terminals behind the EL1252, and between it and the coupler.
            clock: whether the coupler (an EK1100) has a distributed clock.
            in_bytes: another EEPROM of the EL1252.
            slow_ns: time to enter a state; it then needs process data before it runs.
        """
        self.coupler = ek1100(self._drifts[0], clock) if coupler == EK1100 else ek1101(self._drifts[0], coupler)
        self.terminal, self.inputs = el1252(self._drifts[1], terminal, in_bytes)
        self.terminal.slow_ns = slow_ns
        self.all_inputs = [self.inputs]  # the EL1252 that ``terminal`` is, then the others in order of the line
        self.slaves: list[Esc] = [self.coupler, *map(self._further, before), self.terminal]
        self.slaves += map(self._further, behind)
        self.present = len(self.slaves)
        self.loss = 0.0
        self.drop_next = self.late_next = self.cheat_next = 0
        self.delay_ns = self.late_ns = 0
        self.stale = False
        self.deaf = 0
        self.pauses: list[tuple[int, int]] = []
        self._cycle_ns = t_ns
        self._past: deque[bytes] = deque(maxlen=17)
        self.counts: Counter[str] = Counter()
        self._random = random.Random(self._seed)
        self._held: list[tuple[int, int, bytes]] = []
        self._order = 0
        for slave in self.slaves:
            slave.power_on(t_ns)
        self._plug(len(self.slaves))

    def _further(self, product: int) -> Esc:
        if product != EL1252:
            return other_terminal(product)
        slave, inputs = el1252(-self._drifts[1])
        self.all_inputs.append(inputs)
        return slave

    # --- frames -----------------------------------------------------------------------------------------------

    def take(self, frame: bytes, t_ns: int) -> bytes | None:
        """The answer to send now, or None: it is lost, or held back."""
        self._advance(t_ns)
        if self.present == 0:
            self.counts["unheard"] += 1
            return None
        cheat = -1 if self.cheat_next > 0 and is_process_data(frame) else 0
        self.cheat_next += cheat
        reply = answer(frame, self.slaves[: self.present], t_ns, cheat)
        if reply is None:
            return None
        self.counts["frames"] += 1
        if is_process_data(frame):
            if t_ns - self._cycle_ns > PAUSE_NS:
                self.pauses.append((self._cycle_ns, t_ns))
            self._cycle_ns = t_ns
        if self.deaf and asks_for_station(frame):
            self.deaf -= 1
            self.counts["lost"] += 1
            return None
        reply = self._aged(frame, reply)
        if self.drop_next > 0 or self._random.random() < self.loss:
            self.drop_next = max(0, self.drop_next - 1)
            self.counts["lost"] += 1
            return None
        wait_ns = self.delay_ns
        if self.late_next > 0:
            self.late_next -= 1
            self.counts["late"] += 1
            wait_ns += self.late_ns
        if wait_ns:
            self._order += 1
            heapq.heappush(self._held, (t_ns + wait_ns, self._order, reply))
            return None
        return reply

    def _advance(self, t_ns: int) -> None:
        for inputs in self.all_inputs:
            inputs.advance(t_ns)

    def _aged(self, frame: bytes, reply: bytes) -> bytes:
        """With ``stale``: the answer of 16 frames ago under the present index, until a master starts over."""
        if not is_process_data(frame):
            self.stale = self.stale and frame[16] != BWR
            return reply
        self._past.append(reply)
        if not self.stale:
            return reply
        return with_index(self._past[0], frame[17])

    def due(self, t_ns: int) -> list[bytes]:
        """Answers whose delay is over."""
        found = []
        while self._held and self._held[0][0] <= t_ns:
            found.append(heapq.heappop(self._held)[2])
        return found

    def next_due_ns(self) -> int | None:
        return self._held[0][0] if self._held else None

    # --- orders -----------------------------------------------------------------------------------------------

    def obey(self, order: Order, t_ns: int) -> Order:
        """One order of the control socket; raises KeyError, TypeError or ValueError on nonsense."""
        action = getattr(self, f"_do_{order['do']}", None)
        if action is None:
            raise ValueError(f"unknown order {order['do']}")
        result: Order | None = action(order, t_ns)
        return result or {}

    def _do_loss(self, order: Order, t_ns: int) -> None:
        """Lose a share of all answers, or the next ones."""
        self.loss = float(order.get("share", 0.0))
        self.drop_next = int(order.get("next", 0))

    def _do_delay(self, order: Order, t_ns: int) -> None:
        """Every answer comes later."""
        self.delay_ns = int(order["ns"])

    def _do_late(self, order: Order, t_ns: int) -> None:
        """The next answers come late, all others in time."""
        self.late_next, self.late_ns = int(order["next"]), int(order["ns"])

    def _do_stale(self, order: Order, t_ns: int) -> None:
        """Process data are 16 frames old, with the right counter, until a master starts from the beginning."""
        self.stale = True

    def _do_cheat(self, order: Order, t_ns: int) -> None:
        """Working counters one short for the next frames with process data."""
        self.cheat_next = int(order["next"])

    def _do_deaf(self, order: Order, t_ns: int) -> None:
        """The next answers to the question for a device's station address are lost."""
        self.deaf = int(order.get("next", 1))

    def _do_unplug(self, order: Order, t_ns: int) -> None:
        """Only the first ``slaves`` of the line answer any more (default: the EL1252 is gone)."""
        self._plug(int(order.get("slaves", 1)))

    def _do_plug(self, order: Order, t_ns: int) -> None:
        self._plug(len(self.slaves))

    def _plug(self, present: int) -> None:
        self.present = present
        for number, slave in enumerate(self.slaves, 1):
            slave.ports = 0x03 if number < present else 0x01
            slave.show_ports()

    def _do_power(self, order: Order, t_ns: int) -> None:
        """Power-cycle: "terminal" (default), "coupler" or "all"."""
        self._advance(t_ns)
        which = order.get("which", "terminal")
        if which not in ("terminal", "coupler", "all"):
            raise ValueError(f"nothing is called {which}")
        for name, slave in (("coupler", self.coupler), ("terminal", self.terminal)):
            if which in (name, "all"):
                slave.power_on(t_ns)

    def _do_state(self, order: Order, t_ns: int) -> None:
        """Put the EL1252 into a state, e.g. 1 = INIT."""
        self.terminal.set_state(int(order["state"]))

    def _do_al_error(self, order: Order, t_ns: int) -> None:
        """SAFE-OP with the error flag (default code: synchronisation error)."""
        self.terminal.set_state(SAFE_OP | ERROR, int(order.get("code", 0x001A)))

    def _do_identity(self, order: Order, t_ns: int) -> None:
        """Other slaves than expected: product codes of the first and the second, and more (see ``build``)."""
        self.build(
            t_ns,
            int(order.get("coupler", EK1101)),
            int(order.get("terminal", EL1252)),
            tuple(int(product) for product in order.get("behind", ())),
            bool(order.get("clock", True)),
            bool(order.get("in_bytes", False)),
            int(order.get("slow_ns", 0)),
            tuple(int(product) for product in order.get("before", ())),
        )

    def _do_astray(self, order: Order, t_ns: int) -> None:
        """The EL1252's clock does not follow the coupler's any more, and runs fast by ``drift`` (s/s) from now on."""
        slave = self.terminal
        slave.trim_ns -= (t_ns - slave.powered_ns) * (float(order["drift"]) - slave.drift)
        slave.follows, slave.drift = False, float(order["drift"])

    def _do_register(self, order: Order, t_ns: int) -> Order:
        """Read the EL1252's memory, or write it if ``value`` (hex) is given."""
        address = int(order["address"])
        if "value" in order:
            self.terminal.write(address, bytes.fromhex(order["value"]), t_ns)
            return {}
        found = self.terminal.read(address, int(order["length"]), t_ns)
        return {"value": (found or b"").hex()}

    def _do_stubborn(self, order: Order, t_ns: int) -> None:
        """A register of the EL1252 does not take what is written to it."""
        self.terminal.stubborn = ((int(order["address"]), int(order["address"]) + int(order.get("length", 1))),)

    def _do_edges(self, order: Order, t_ns: int) -> Order:
        """Edges to come: [[host ns, channel, level], …], or with ``relative`` ns from now on; of the EL1252 number
        ``terminal``, see ``all_inputs``."""
        base = t_ns if order.get("relative") else 0
        edges = [(base + int(at), int(channel), int(level)) for at, channel, level in order["edges"]]
        if any(channel not in (1, 2) or level not in (0, 1) for _, channel, level in edges):
            raise ValueError("channels are 1 and 2, levels 0 and 1")
        self.all_inputs[int(order.get("terminal", 0))].add(edges)
        return {"t_ns": base}

    def _do_log(self, order: Order, t_ns: int) -> Order:
        """Edges with their stamps, counts, number of edges still to come; pauses between frames with process data
        since the host time ``since``, number and sum. ``first``, ``count``: of edges, as an answer must fit into a
        datagram."""
        self._advance(t_ns)
        inputs = self.all_inputs[int(order.get("terminal", 0))]
        first = int(order.get("first", 0))
        done = inputs.done[first : first + int(order.get("count", len(inputs.done)))]
        edges = [[e.t_ns, e.channel, e.level, e.stamp_ns] for e in done]
        pauses = [until - begun for begun, until in self.pauses if until > int(order.get("since", 0))]
        return {"t_ns": t_ns, "edges": edges, "coming": len(inputs.coming), "counts": dict(self.counts),
                "pauses": len(pauses), "paused_ns": sum(pauses)}  # fmt: skip

    def _do_heal(self, order: Order, t_ns: int) -> None:
        """All faults end; slaves keep the state that they are in."""
        self.loss, self.drop_next, self.late_next, self.cheat_next, self.delay_ns, self.deaf = 0.0, 0, 0, 0, 0, 0
        self._plug(len(self.slaves))
