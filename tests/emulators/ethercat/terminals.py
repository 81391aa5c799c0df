"""EK1101 and EL1252: their EEPROMs, and the inputs and latch unit of the EL1252."""

from __future__ import annotations

import struct
from collections import deque
from dataclasses import dataclass, field

from .esc import Esc

BECKHOFF = 0x2
EK1101, EK1100, EL1252 = 0x044D2C52, 0x044C2C52, 0x04E43052
EL1002, EL1008, EL2008 = 0x03EA3052, 0x03F03052, 0x07D83052
INPUTS, LATCH_STATUS, LATCH_STAMPS = 0x1000, 0x09AE, 0x09B0
_ALL_LATCHES = (LATCH_STATUS, 34)


def sii(
    vendor: int,
    product: int,
    revision: int,
    name: str,
    sync_managers: tuple[tuple[int, int], ...],
    pdos: tuple[tuple[int, tuple[int, ...]], ...],
    outputs: bool = False,
) -> bytes:
    """An EEPROM. ``sync_managers``: (start, length) of inputs; ``pdos``: (sync manager, bits of each entry).

    ``outputs``: they are outputs instead.
    """
    words = bytearray(128)
    struct.pack_into("<IIII", words, 16, vendor, product, revision, 1)
    text = name.encode()
    strings = bytes((1, len(text))) + text
    general = bytearray(32)
    general[0:4] = bytes((1, 1, 1, 1))
    fmmu = bytes(1 if outputs else 2 for _ in sync_managers)
    control, kind = (0x44, 3) if outputs else (0x00, 4)
    sm = b"".join(struct.pack("<HHBBBB", start, length, control, 0, 1, kind) for start, length in sync_managers)
    tx = b""
    for k, (manager, entries) in enumerate(pdos):
        tx += struct.pack("<HBBBBH", 0x1A00 + k, len(entries), manager, 0, 0, 0x11)
        for sub, bits in enumerate(entries, 1):
            tx += struct.pack("<HBBBBH", 0x6000 + 16 * k, sub, 0, 1 if bits == 1 else 0x1B, bits, 0)
    for category, body in ((10, strings), (30, bytes(general)), (40, fmmu), (41, sm), (51 if outputs else 50, tx)):
        if not body:
            continue
        padded = body + b"\x00" * (len(body) % 2)
        words += struct.pack("<HH", category, len(padded) // 2) + padded
    words += b"\xff" * 8
    words += b"\xff" * (-len(words) % 8)
    return bytes(words)


def ek1101(drift: float = 0.0, product: int = EK1101) -> Esc:
    """The coupler: 16 bits of ID switch, and the reference clock."""
    slave = Esc("EK1101", sii(BECKHOFF, product, 0x00110000, "EK1101", ((0x1000, 2),), ((0, (16,)),)), drift)
    slave.after_power_on = lambda: slave.put(0x1000, 0x0011, 2)
    return slave


def ek1100(drift: float = 0.0, clock: bool = True) -> Esc:
    """The coupler without an ID switch: no process data at all. ``clock``: whether it has a distributed clock."""
    slave = Esc("EK1100", sii(BECKHOFF, EK1100, 0x00120000, "EK1100", (), ()), drift)
    if not clock:
        slave.after_power_on = lambda: slave.put(0x0008, 0x0000, 2)
    return slave


def other_terminal(product: int) -> Esc:
    """What else may be on the line: two or eight inputs (EL1002, EL1008), or eight outputs (EL2008)."""
    outputs = product == EL2008
    name, start = {EL1002: "EL1002", EL2008: "EL2008"}.get(product, "EL1008"), 0x0F00 if outputs else 0x1000
    pdos = tuple((0, (1,)) for _ in range(2 if product == EL1002 else 8))
    return Esc(name, sii(BECKHOFF, product, 0x00110000, name, ((start, 1),), pdos, outputs))


@dataclass
class LatchedEdge:
    """``stamp_ns``: what the terminal's clock said, or None where the latch unit was off."""

    t_ns: int
    channel: int
    level: int
    stamp_ns: int | None


@dataclass
class Inputs:
    """The two inputs of an EL1252 and the edges still to come, in order of host time."""

    slave: Esc
    levels: list[int] = field(default_factory=lambda: [0, 0])
    coming: deque[tuple[int, int, int]] = field(default_factory=deque)
    done: list[LatchedEdge] = field(default_factory=list)
    on: bool = True

    def add(self, edges: list[tuple[int, int, int]]) -> None:
        """Edges (host ns, channel 1 or 2, level)."""
        self.coming = deque(sorted([*self.coming, *edges]))

    def advance(self, t_ns: int) -> None:
        """All edges up to ``t_ns`` happen: levels change, and the latch unit stamps them if it is on."""
        while self.coming and self.coming[0][0] <= t_ns:
            at_ns, channel, level = self.coming.popleft()
            if self.levels[channel - 1] == level:
                continue
            self.levels[channel - 1] = level
            self.done.append(LatchedEdge(at_ns, channel, level, self._latch(at_ns, channel, level)))
        if self.on:
            self.slave.memory[INPUTS] = self.levels[0] | (self.levels[1] << 1)

    def _latch(self, t_ns: int, channel: int, level: int) -> int | None:
        memory = self.slave.memory
        # Latch units must be the bus's, not the terminal's (0x0980), and the unit switched on (0x0981).
        if not self.on or memory[0x0981] != 0x01 or memory[0x0980] & (0x10 << (channel - 1)):
            return None
        single = memory[0x09A8 + channel - 1] & (0x01 if level else 0x02)
        flag = 0x01 if level else 0x02
        status = LATCH_STATUS + channel - 1
        stamp = self.slave.system_time(t_ns)
        if single and memory[status] & flag:
            return None  # the first edge is held until it has been read
        if single:
            memory[status] |= flag
        self.slave.put(LATCH_STAMPS + 16 * (channel - 1) + (0 if level else 8), stamp, 8)
        return stamp

    def before_read(self, address: int, length: int, t_ns: int) -> None:
        end = address + length
        if address <= INPUTS < end or (address < LATCH_STATUS + 34 and end > LATCH_STATUS):
            self.advance(t_ns)

    def after_read(self, address: int, length: int) -> None:
        """Reading a stamp frees a latch in single-event mode."""
        for channel in (0, 1):
            for flag, stamp in ((0x01, LATCH_STAMPS + 16 * channel), (0x02, LATCH_STAMPS + 16 * channel + 8)):
                if address <= stamp < address + length:
                    self.slave.memory[LATCH_STATUS + channel] &= ~flag


def el1252(drift: float = 0.0, product: int = EL1252, in_bytes: bool = False) -> tuple[Esc, Inputs]:
    """The terminal with its inputs; the second sync manager lies below the first, as on the real one.

    ``in_bytes``: an EEPROM with the same image in other entries, and another revision.
    """
    latches: tuple[int, ...] = (8,) * 34 if in_bytes else (8, 8, 64, 64, 64, 64)
    inputs_pdos = ((0, (1, 1, 6)),) if in_bytes else ((0, (1,)), (0, (1,)))
    revision = 0x00100000 if in_bytes else 0x00120000
    managers = ((INPUTS, 1), _ALL_LATCHES)
    image = sii(BECKHOFF, product, revision, "EL1252", managers, (*inputs_pdos, (1, latches)))
    slave = Esc("EL1252", image, drift)
    inputs = Inputs(slave)
    slave.before_read, slave.after_read = inputs.before_read, inputs.after_read
    return slave, inputs
