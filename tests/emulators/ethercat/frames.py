"""EtherCAT frames: every datagram walks through the chain of slaves."""

from __future__ import annotations

import struct
from collections.abc import Sequence

from .esc import Esc
from .logical import exchange

ETHERTYPE = 0x88A4
(NOP, APRD, APWR, APRW, FPRD, FPWR, FPRW, BRD, BWR, BRW, LRD, LWR, LRW, ARMW, FRMW) = range(15)
_READS = {APRD, APRW, FPRD, FPRW, BRD, BRW}
_WRITES = {APWR, APRW, FPWR, FPRW, BWR, BRW}


def is_process_data(frame: bytes) -> bool:
    """Whether the first datagram is a logical one."""
    return len(frame) > 16 and frame[16] in (LRD, LWR, LRW)


def asks_for_station(frame: bytes) -> bool:
    """Whether it reads the station address of a device by its place on the line."""
    return len(frame) > 20 and frame[16] == APRD and frame[20:22] == b"\x10\x00"


def with_index(frame: bytes, index: int) -> bytes:
    """The same answer as if it belonged to the frame sent with another index."""
    out = bytearray(frame)
    position, more = 16, True
    while more and position + 12 <= len(out):
        out[position + 1] = index
        flags = struct.unpack_from("<H", out, position + 6)[0]
        position, more = position + 12 + (flags & 0x07FF), bool(flags & 0x8000)
    return bytes(out)


def answer(frame: bytes, chain: Sequence[Esc], t_ns: int, cheat_wkc: int = 0) -> bytes | None:
    """The answer to an Ethernet frame, or None if it is no EtherCAT frame.

    Args:
        chain: the slaves that the frame reaches, in order.
        t_ns: its arrival.
        cheat_wkc: added to the working counter of process data (a fault to inject).
    """
    if len(frame) < 28 or frame[12:14] != b"\x88\xa4":
        return None
    out = bytearray(frame)
    out[6] |= 0x02  # the first slave marks the source address, as ESCs do
    header = struct.unpack_from("<H", frame, 14)[0]
    if header >> 12 != 1:
        return None
    position, end = 16, min(16 + (header & 0x07FF), len(frame))
    while position + 12 <= end:
        command, _, place, offset, flags = struct.unpack_from("<BBHHH", out, position)
        length = flags & 0x07FF
        data_at = position + 10
        if data_at + length + 2 > end:
            break
        data = out[data_at : data_at + length]
        counter = struct.unpack_from("<H", out, data_at + length)[0]
        address = (offset << 16) | place
        for index, slave in enumerate(chain):
            at_ns = t_ns + index * slave.hop_ns
            if command in (LRD, LWR, LRW):
                counter += exchange(slave, address, data, command != LWR, command != LRD, at_ns)
                counter += cheat_wkc if index == 0 else 0
            elif command != NOP:
                counter += _physical(slave, command, place, offset, data, at_ns)
                if command in (APRD, APWR, APRW, BRD, BWR, BRW, ARMW):
                    place = (place + 1) & 0xFFFF
        struct.pack_into("<H", out, position + 2, place)
        out[data_at : data_at + length] = data
        struct.pack_into("<H", out, data_at + length, counter & 0xFFFF)
        position = data_at + length + 2
        if not flags & 0x8000:
            break
    return bytes(out)


def _physical(slave: Esc, command: int, place: int, offset: int, data: bytearray, t_ns: int) -> int:
    """One slave's part of a datagram to a physical address; returns what it adds to the working counter."""
    if command in (ARMW, FRMW):
        addressed = place == (0 if command == ARMW else slave.station)
        if not addressed:
            return int(slave.write(offset, bytes(data), t_ns))
        found = slave.read(offset, len(data), t_ns)
        if found is not None:
            data[:] = found
        return int(found is not None)
    broadcast = command in (BRD, BWR, BRW)
    if not broadcast and place != (0 if command in (APRD, APWR, APRW) else slave.station):
        return 0
    added = 0
    incoming = bytes(data)
    if command in _READS:
        found = slave.read(offset, len(data), t_ns)
        if found is not None:
            data[:] = bytes(a | b for a, b in zip(data, found, strict=True)) if broadcast else found
            added += 1
    if command in _WRITES and slave.write(offset, incoming, t_ns):
        added += 2 if command in _READS else 1
    return added
