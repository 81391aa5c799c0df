"""Logical addressing: what an FMMU maps, bit by bit where it must."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .esc import Esc

FMMU_BASE = 0x0600
_LAYOUT = struct.Struct("<IHBBHBBBxxx")


@dataclass(frozen=True)
class Fmmu:
    logical: int
    length: int
    start_bit: int
    stop_bit: int
    physical: int
    physical_bit: int
    readable: bool
    writable: bool

    @property
    def whole_bytes(self) -> bool:
        return self.start_bit == 0 and self.stop_bit == 7 and self.physical_bit == 0

    @property
    def physical_length(self) -> int:
        bits = 8 * (self.length - 1) + self.stop_bit - self.start_bit + 1
        return (self.physical_bit + bits + 7) // 8


def read_fmmus(memory: bytearray) -> tuple[Fmmu, ...]:
    """The active ones of the eight."""
    found = []
    for k in range(8):
        logical, length, start, stop, physical, bit, kind, active = _LAYOUT.unpack_from(memory, FMMU_BASE + 16 * k)
        if active & 1 and length:
            found.append(Fmmu(logical, length, start & 7, stop & 7, physical, bit & 7, bool(kind & 1), bool(kind & 2)))
    return tuple(found)


def exchange(slave: Esc, address: int, data: bytearray, reads: bool, writes: bool, t_ns: int) -> int:
    """One slave's part of LRD, LWR or LRW; returns what it adds to the working counter (read 1, write 1 or 2)."""
    if slave.state & 0x0F == 1:  # INIT: no process data
        return 0
    slave.exchanged = True
    was_read = was_written = False
    outgoing = bytes(data)
    for fmmu in slave.fmmus:
        first, last = max(address, fmmu.logical), min(address + len(data), fmmu.logical + fmmu.length)
        if first >= last:
            continue
        if fmmu.writable and writes:
            was_written |= _write(slave, fmmu, address, outgoing, first, last, t_ns)
        if fmmu.readable and reads:
            was_read |= _read(slave, fmmu, address, data, first, last, t_ns)
    return int(was_read) + int(was_written) * (2 if reads else 1)


def _read(slave: Esc, fmmu: Fmmu, address: int, data: bytearray, first: int, last: int, t_ns: int) -> bool:
    if fmmu.whole_bytes:
        found = slave.read(fmmu.physical + first - fmmu.logical, last - first, t_ns)
        if found is None:
            return False
        data[first - address : last - address] = found
        return True
    found = slave.read(fmmu.physical, fmmu.physical_length, t_ns)
    if found is None:
        return False
    bits = int.from_bytes(found, "little") >> fmmu.physical_bit
    for position in _positions(fmmu, first, last):
        byte, bit = divmod(position, 8)
        place = fmmu.logical + byte - address
        value = (bits >> (position - fmmu.start_bit)) & 1
        data[place] = (data[place] & ~(1 << bit)) | (value << bit)
    return True


def _write(slave: Esc, fmmu: Fmmu, address: int, data: bytes, first: int, last: int, t_ns: int) -> bool:
    if fmmu.whole_bytes:
        return slave.write(fmmu.physical + first - fmmu.logical, data[first - address : last - address], t_ns)
    old = slave.read(fmmu.physical, fmmu.physical_length, t_ns)
    if old is None:
        return False
    bits = int.from_bytes(old, "little")
    for position in _positions(fmmu, first, last):
        byte, bit = divmod(position, 8)
        target = position - fmmu.start_bit + fmmu.physical_bit
        value = (data[fmmu.logical + byte - address] >> bit) & 1
        bits = (bits & ~(1 << target)) | (value << target)
    return slave.write(fmmu.physical, bits.to_bytes(fmmu.physical_length, "little"), t_ns)


def _positions(fmmu: Fmmu, first: int, last: int) -> range:
    """Bits of the FMMU's logical range, counted from bit 0 of its first byte, within the datagram."""
    begin = max(fmmu.start_bit, 8 * (first - fmmu.logical))
    end = min(8 * (fmmu.length - 1) + fmmu.stop_bit + 1, 8 * (last - fmmu.logical))
    return range(begin, end)
