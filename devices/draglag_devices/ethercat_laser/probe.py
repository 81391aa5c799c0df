"""Finds EtherCAT devices by broadcast reads and their EEPROM."""

from __future__ import annotations

import contextlib
import fcntl
import select
import socket
import struct
import time
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

from draglag.messages import message
from draglag_devices.ethercat_laser.preflight import ETHERTYPE, has_rights, link_state, other_master
from draglag_devices.ethercat_laser.surroundings import used_addresses, why_not_ask
from draglag_devices.ethercat_laser.waits import PROBE_ANSWER_S

_SIOCGIFHWADDR, _ETHERNET, _UP = 0x8927, 1, 0x1
# Commands: read and write by place on the line, read all.
_APRD, _APWR, _BRD = 1, 2, 7
_TYPE, _STATE, _EEPROM_OWNER, _EEPROM, _EEPROM_DATA = 0x0000, 0x0130, 0x0500, 0x0502, 0x0508
_PREOP, _STATE_MASK, _OWNED, _BUSY = 2, 0x0F, 0x01, 0x8000
_READ_EEPROM = 0x0100
_VENDOR, _PRODUCT = 0x0008, 0x000A
_TRIES = 5
_FRAME = struct.Struct("<HBBHHHH")
_FIRST_INDEX = 0x7F
# A longer line is nobody's laser.
_MAX_REQUESTS = 64
NOT_ALLOWED = message("was not allowed when the EtherCAT helper was installed")


def scan_bus(
    asked: Collection[str] = (), send: bool = True, only: Collection[str] | None = None
) -> list[dict[str, Any]]:
    """One entry per Ethernet interface: name, up, carrier, rights, busy, slaves, kinds, left_alone (why not asked).

    Args:
        asked: interfaces to ask even though others use them.
        send: whether frames may be sent.
        only: interfaces that may be asked; any if None.
    """
    rights = has_rights()
    try:
        addresses, blind = used_addresses(), ""
    except OSError:
        addresses, blind = {}, message("has addresses that cannot be read")
    entries = []
    for index, name in socket.if_nameindex():
        if _ethernet(name):
            why = "" if name in asked else blind or why_not_ask(name, addresses.get(index, []))
            if not why and only is not None and name not in only:
                why = NOT_ALLOWED
            with contextlib.suppress(OSError):  # it went meanwhile
                entries.append(_probe(name, rights, why, send))
    return entries


def _probe(interface: str, rights: bool, left_alone: str, send: bool) -> dict[str, Any]:
    flags, carrier = link_state(interface)
    busy = other_master(interface)
    # The answer to our question would confuse a master that is at work there.
    ask = send and rights and carrier and flags & _UP and not busy and not left_alone
    slaves = count_slaves(interface) if ask else 0
    return {"name": interface, "up": bool(flags & _UP), "carrier": carrier, "rights": rights, "busy": busy,
            "slaves": slaves, "kinds": kinds(interface, slaves), "left_alone": left_alone}  # fmt: skip


def _request(interface: str, request: int) -> bytes:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as control:
        return fcntl.ioctl(control, request, interface.encode().ljust(16, b"\0") + bytes(24))


def _ethernet(interface: str) -> bool:
    with contextlib.suppress(OSError):
        return bool(struct.unpack_from("<H", _request(interface, _SIOCGIFHWADDR), 16)[0] == _ETHERNET)
    return False


def count_slaves(interface: str, within_s: float = PROBE_ANSWER_S, index: int = _FIRST_INDEX) -> int:
    """Number of devices that answer in time; ``index`` excludes late answers."""
    with contextlib.suppress(OSError), _Line(interface, within_s, index) as line:
        return line.exchange(_BRD, 0, _TYPE, bytes(2))[0]
    return 0


def kinds(interface: str, count: int) -> list[tuple[int, int]]:
    """(vendor, product) of each device; (0, 0) where unknown or in use."""
    with contextlib.suppress(OSError), _Line(interface) as line:
        return [
            (line.eeprom(place, _VENDOR), line.eeprom(place, _PRODUCT)) for place in range(min(count, _MAX_REQUESTS))
        ]
    return []


@dataclass
class _Line:
    """Single frames on an interface. Raises OSError."""

    interface: str
    within_s: float = PROBE_ANSWER_S
    index: int = _FIRST_INDEX

    def __enter__(self) -> _Line:
        self._wire = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0)
        try:
            self._wire.bind((self.interface, ETHERTYPE))
        except OSError:
            self._wire.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._wire.close()

    def exchange(self, command: int, place: int, address: int, data: bytes) -> tuple[int, bytes]:
        self.index = (self.index + 1) % 256
        question = _FRAME.pack(0x1000 | 12 + len(data), command, self.index, place, address, len(data), 0) + data
        frame = b"\xff" * 6 + b"\x02\x44\x4c\x00\x00\x01" + struct.pack(">H", ETHERTYPE) + question + bytes(2)
        self._wire.send(frame.ljust(60, b"\0"))
        until = time.monotonic() + self.within_s
        end = 26 + len(data)
        while (left := until - time.monotonic()) > 0 and select.select([self._wire], [], [], left)[0]:
            answer, sender = self._wire.recvfrom(2048)
            if sender[2] != socket.PACKET_OUTGOING and answer[16:18] == bytes((command, self.index)):
                return int(struct.unpack_from("<H", answer, end)[0]), answer[26:end]
        return 0, bytes(len(data))

    def eeprom(self, place: int, word: int) -> int:
        back = -place & 0xFFFF
        owner, state = self._read(back, _EEPROM_OWNER, 1), self._read(back, _STATE, 1)
        if owner is None or state is None:
            return 0
        if owner & _OWNED:
            if state & _STATE_MASK > _PREOP:
                return 0  # in use by the device itself
            self._write(back, _EEPROM_OWNER, b"\x02")
            self._write(back, _EEPROM_OWNER, b"\x00")
        try:
            self._write(back, _EEPROM, struct.pack("<HI", _READ_EEPROM, word))
            for _ in range(_TRIES):
                status = self._read(back, _EEPROM, 2)
                if status is not None and not status & _BUSY:
                    return self._read(back, _EEPROM_DATA, 4) or 0
            return 0
        finally:
            if owner & _OWNED:
                self._write(back, _EEPROM_OWNER, bytes((owner,)))

    def _read(self, back: int, address: int, size: int) -> int | None:
        for _ in range(_TRIES):
            counter, data = self.exchange(_APRD, back, address, bytes(size))
            if counter == 1:
                return int.from_bytes(data, "little")
        return None

    def _write(self, back: int, address: int, data: bytes) -> None:
        for _ in range(_TRIES):
            if self.exchange(_APWR, back, address, data)[0] == 1:
                return
