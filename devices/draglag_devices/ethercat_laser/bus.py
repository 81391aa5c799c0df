"""The EtherCAT bus, through pysoem."""

from __future__ import annotations

import contextlib
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pysoem

from draglag.messages import Message, chained, joined, message
from draglag_devices.ethercat_laser.clockwatch import Pair
from draglag_devices.ethercat_laser.edges import IMAGE
from draglag_devices.ethercat_laser.kinds import BECKHOFF, COUPLERS, EL1252
from draglag_devices.ethercat_laser.refusal import Refusal
from draglag_devices.ethercat_laser.waits import ANSWER_US, STATE_REQUEST_US, STATE_S

_SYSTEM_TIME, _AGREE_NS = 0x0910, 1_000_000
_FMMU0, _CYCLIC_UNIT, _LATCH_MODE = 0x0600, 0x0980, 0x09A8
_INPUTS, _LATCHES = 0x1000, 0x09AE
_FMMU = struct.Struct("<IHBBHBBB3x")
_LATCH_ON = b"\x00\x01"  # 0x0980: the bus controls the unit; 0x0981: on, no SYNC signals
_SETTLING_CYCLES = 50
# AL status: four bits of state and the error flag; above them a device may say more (identification loaded).
_STATE, _STATE_AND_ERROR, _ERROR = 0x0F, 0x1F, 0x10
_TRIES = 5
_STATES = {1: "INIT", 2: "PRE-OP", 3: "BOOT", 4: "SAFE-OP", 8: "OP"}


@dataclass(frozen=True)
class Cycle:
    """One exchange; ``wkc``: working counter, −1 without an answer."""

    wkc: int
    pair: Pair
    image: bytes


class Bus:
    """A bus in OP; close it, as pysoem keeps the socket otherwise. Questions to the terminal raise pysoem.WkcError."""

    def __init__(self, interface: str, position: int = 0, progress: Callable[[], None] = lambda: None) -> None:
        """Set the bus up. Raises Refusal, with nothing left open.

        Args:
            position: of the EL1252 on the line, coupler 1; 0: the only one.
            progress: called after each step; may raise.
        """
        self.interface, self.position = interface, position
        self._progress = progress
        self._master: Any = pysoem.Master()
        self._open = False
        try:
            self._bring_up()
        except (pysoem.WkcError, pysoem.ConfigMapError, struct.error) as error:
            self.close()
            raise Refusal(
                "unsteady",
                message(
                    "the EtherCAT devices on {name} stopped answering while being set up ({why})",
                    name=interface,
                    why=type(error).__name__,
                ),
                "check the cable and the supply of the coupler",
            ) from None
        except BaseException:
            self.close()
            raise

    def _bring_up(self) -> None:
        master = self._master
        try:
            master.open(self.interface)
        except ConnectionError:
            raise Refusal(
                "no_interface",
                message("the network interface {name} cannot be opened", name=self.interface),
                "check that it is an Ethernet interface",
            ) from None
        self._open = True
        master.manual_state_change = 1
        if master.config_init() <= 0:
            raise Refusal(
                "no_slaves",
                message("no EtherCAT device answers on {name}", name=self.interface),
                "check that the cable is in the IN port of the EK1101 and that its 24 V supply is on",
            )
        self._progress()
        self.terminal = self._identify()
        self._enter(pysoem.PREOP_STATE)
        master.config_map()
        self._progress()
        wanted = self._split_mapping()
        for _ in range(_TRIES):
            master.config_dc()
            self._progress()
            if self._clocks_agree():
                break
        # After config_init, which clears 0x0981; not by dc_sync, which would also switch SYNC0 on.
        self._write(_LATCH_MODE, b"\x00\x00")
        self._write(_CYCLIC_UNIT, _LATCH_ON)
        for _ in range(_SETTLING_CYCLES):
            self.cycle()
        self._enter(pysoem.SAFEOP_STATE)
        self.cycle()
        self._enter(pysoem.OP_STATE)
        self._wanted = wanted
        # Not SOEM's own number, which leaves out devices with less than a byte of inputs: a device adds 1 where it
        # is read and 2 where it is written.
        self.expected_wkc = sum(bool(slave.input) + 2 * bool(slave.output) for slave in master.slaves)
        if len(self.terminal.input) != IMAGE.size or not self.as_set_up():
            raise Refusal(
                "set_up",
                message("the EL1252 on {name} does not keep its set-up (mapping or latch unit)", name=self.interface),
                "switch its 24 V supply off and on; if this stays, the terminal is not a usable EL1252",
            )

    def _identify(self) -> Any:
        slaves = self._master.slaves
        found = [(slave.man, slave.id) for slave in slaves]
        places = [place for place, kind in enumerate(found, 1) if kind == (BECKHOFF, EL1252)]
        if any(vendor == 0 or product == 0 for vendor, product in found):
            raise Refusal(
                "unsteady",
                message(
                    "the EtherCAT devices on {name} do not identify themselves: answers get lost", name=self.interface
                ),
                "check the cable and the supply of the coupler",
            )
        if not places or not any((BECKHOFF, coupler) in found for coupler in COUPLERS):
            names = joined(", ", (_named(slave) for slave in slaves))
            raise Refusal(
                "wrong_slaves",
                message(
                    "the EtherCAT devices on {name} are not an EK1101 with an EL1252, but: {found}",
                    name=self.interface,
                    found=names,
                ),
                "connect the EK1101 (or an EK1100) with the EL1252, or choose the interface they are on",
            )
        self.position = self._choose(places)
        return slaves[self.position - 1]

    def _choose(self, places: list[int]) -> int:
        line = joined(
            ", ",
            (
                message("{place} {device}", place=place, device=slave.name or message("unnamed"))
                for place, slave in enumerate(self._master.slaves, 1)
            ),
        )
        if self.position and self.position not in places:
            raise Refusal(
                "position",
                message(
                    "at position {place} on {name} there is no EL1252; the line is: {line}",
                    place=self.position,
                    name=self.interface,
                    line=line,
                ),
                message(
                    "write {option} in the laser's address",
                    option=chained("{before} or {next}", (f"position={p}" for p in places)),
                ),
            )
        if not self.position and len(places) > 1:
            raise Refusal(
                "position",
                message(
                    "there are {n} EL1252 on {name}, and the laser may be on any; the line is: {line}",
                    n=len(places),
                    name=self.interface,
                    line=line,
                ),
                message(
                    "say which in the laser's address: {options}",
                    options=chained("{before} or {next}", (f"&position={p}" for p in places)),
                ),
            )
        return self.position or places[0]

    def _split_mapping(self) -> bytes:
        """FMMU 0 and 1 as they must read back; SOEM's single one does not map the stamps (SOEM #873)."""
        logical = _FMMU.unpack(self._read(_FMMU0, 16))[0]
        rest = IMAGE.size - 1
        inputs = _FMMU.pack(logical, 1, 0, 7, _INPUTS, 0, 1, 1)
        latches = _FMMU.pack(logical + 1, rest, 0, 7, _LATCHES, 0, 1, 1)
        self._write(_FMMU0, inputs)
        self._write(_FMMU0 + 16, latches)
        return inputs + latches

    def _clocks_agree(self) -> bool:
        """Whether the terminal's clock follows the bus's: config_dc does not report a lost frame."""
        first, own, second = self.cycle(), self._read(_SYSTEM_TIME, 8), self.cycle()
        own_ns = int.from_bytes(own, "little")
        return first.pair.dc_ns - _AGREE_NS <= own_ns <= second.pair.dc_ns + _AGREE_NS

    def _enter(self, state: int) -> None:
        master = self._master
        until = time.monotonic() + STATE_S
        while True:
            master.state = state
            master.write_state()
            checked = time.monotonic() + STATE_REQUEST_US / 1e6
            while time.monotonic() < checked:
                if state == pysoem.OP_STATE:
                    self.cycle()
                reached = master.state_check(state, STATE_REQUEST_US // 10)
                if reached & _STATE_AND_ERROR == state:
                    self._progress()
                    return
            master.read_state()
            if time.monotonic() > until or any(slave.state & _ERROR for slave in master.slaves):
                break
        raise Refusal(
            "state",
            message(
                "the EtherCAT devices on {name} do not enter {state}: {why}",
                name=self.interface,
                state=_STATES[state],
                why=self.state_trouble(state),
            ),
            "switch the 24 V supply of the coupler off and on",
        )

    def _read(self, address: int, size: int) -> bytes:
        return bytes(self._retried(lambda: self.terminal._fprd(address, size)))

    def _write(self, address: int, data: bytes) -> None:
        self._retried(lambda: self.terminal._fpwr(address, data))

    def _retried(self, exchange: Any) -> Any:
        for attempt in range(_TRIES):
            try:
                return exchange()
            except pysoem.WkcError:
                if attempt == _TRIES - 1:
                    raise
        return None

    # --- running ----------------------------------------------------------------------------------------------

    def cycle(self) -> Cycle:
        """One exchange, with host times around the DC time."""
        before = time.monotonic_ns()
        self._master.send_processdata()
        wkc = self._master.receive_processdata(ANSWER_US)
        after = time.monotonic_ns()
        return Cycle(int(wkc), Pair(int(self._master.dc_time), before, after), self.terminal.input)

    def terminal_clock(self) -> Pair:
        """The EL1252's clock."""
        before = time.monotonic_ns()
        own = self._read(_SYSTEM_TIME, 8)
        return Pair(int.from_bytes(own, "little"), before, time.monotonic_ns())

    def in_operation(self) -> bool:
        """Whether every device reports OP; the working counter shows no error in SAFE-OP."""
        return self._master.read_state() & _STATE_AND_ERROR == pysoem.OP_STATE and all(
            slave.state & _STATE_AND_ERROR == pysoem.OP_STATE for slave in self._master.slaves
        )

    def state_trouble(self, wanted: int = pysoem.OP_STATE) -> Message:
        """Devices in another state, and why."""
        self._master.read_state()
        parts = []
        for slave in self._master.slaves:
            if slave.state & _STATE_AND_ERROR != wanted:
                name = _STATES.get(slave.state & _STATE, message("no state at all"))
                why = pysoem.al_status_code_to_string(slave.al_status) if slave.al_status else ""
                where = message("{device} is in {state}", device=slave.name, state=name)
                parts.append(message("{where} ({why})", where=where, why=why) if why else where)
        return joined(", ", parts) if parts else message("not all devices answer")

    def as_set_up(self) -> bool:
        """Whether mapping and latch unit read back as written."""
        found = self._read(_FMMU0, 32)  # the last three bytes of an FMMU mean nothing
        return found[:13] == self._wanted[:13] and found[16:29] == self._wanted[16:29] and self.latching()

    def latching(self) -> bool:
        """Whether the latch unit is on."""
        return self._read(_CYCLIC_UNIT + 1, 1) == _LATCH_ON[1:]

    def describe(self) -> list[dict[str, int | str]]:
        """Name, product and revision of every device."""
        return [{"name": s.name, "product": int(s.id), "revision": int(s.rev)} for s in self._master.slaves]

    def close(self) -> None:
        """Put devices in INIT, release the interface."""
        if not self._open:
            return
        self._open = False
        with contextlib.suppress(Exception):  # whatever state pysoem is in, the socket must go
            self._master.state = pysoem.INIT_STATE
            self._master.write_state()
        self._master.close()


def _named(slave: Any) -> Message:
    return message(
        "{device} (vendor {vendor}, product {product})",
        device=slave.name or message("unnamed"),
        vendor=f"0x{slave.man:X}",
        product=f"0x{slave.id:08X}",
    )
