"""Which interfaces have EtherCAT devices: one broadcast read each, which changes nothing on the bus."""

from __future__ import annotations

import contextlib
import fcntl
import select
import socket
import struct
import time
from typing import Any

from draglag_devices.ethercat_laser.preflight import ETHERTYPE, has_rights, link_state, other_master

_SIOCGIFHWADDR, _SIOCGIFADDR, _ETHERNET, _UP = 0x8927, 0x8915, 1, 0x1
_WAIT_S = 0.03


def probe_all() -> list[dict[str, Any]]:
    """One entry per Ethernet interface: name, up, carrier, rights, busy, has_ip, slaves."""
    rights = has_rights()
    return [_probe(name, rights) for _, name in socket.if_nameindex() if _ethernet(name)]


def _probe(interface: str, rights: bool) -> dict[str, Any]:
    flags, carrier = link_state(interface)
    busy = other_master(interface)
    # The answer to our question would confuse a master that is at work there.
    slaves = count_slaves(interface) if rights and carrier and flags & _UP and not busy else 0
    return {"name": interface, "up": bool(flags & _UP), "carrier": carrier, "rights": rights, "busy": busy,
            "has_ip": _has_ip(interface), "slaves": slaves}  # fmt: skip


def _request(interface: str, request: int) -> bytes:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as control:
        return fcntl.ioctl(control, request, interface.encode().ljust(16, b"\0") + bytes(24))


def _ethernet(interface: str) -> bool:
    with contextlib.suppress(OSError):
        return bool(struct.unpack_from("<H", _request(interface, _SIOCGIFHWADDR), 16)[0] == _ETHERNET)
    return False


def _has_ip(interface: str) -> bool:
    try:
        _request(interface, _SIOCGIFADDR)
    except OSError:
        return False
    return True


def count_slaves(interface: str, within_s: float = _WAIT_S, index: int = 0x7F) -> int:
    """Working counter of one broadcast read of the two type bytes, 0 without an answer in time.

    ``index`` tells the answer from a late one to an earlier question.
    """
    question = struct.pack("<HBBHHHHHH", 0x1000 | 14, 7, index, 0, 0, 2, 0, 0, 0)
    with contextlib.suppress(OSError), socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0) as wire:
        wire.bind((interface, ETHERTYPE))
        frame = b"\xff" * 6 + b"\x02\x44\x4c\x00\x00\x01" + struct.pack(">H", ETHERTYPE) + question
        wire.send(frame.ljust(60, b"\0"))
        until = time.monotonic() + within_s
        while (left := until - time.monotonic()) > 0 and select.select([wire], [], [], left)[0]:
            answer, sender = wire.recvfrom(2048)
            if sender[2] != socket.PACKET_OUTGOING and answer[16:18] == bytes((7, index)):
                return int(struct.unpack_from("<H", answer, 28)[0])
    return 0
