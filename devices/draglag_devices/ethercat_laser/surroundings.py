"""Interfaces that may be asked for EtherCAT devices: broadcasts disturb networks in use."""

from __future__ import annotations

import contextlib
import socket
import struct
from ipaddress import ip_address
from pathlib import Path

from draglag.messages import message
from draglag_devices.ethercat_laser.waits import ADDRESSES_S

_NET = Path("/sys/class/net")
_GETADDR, _NEWADDR, _DONE, _ERROR = 22, 20, 3, 2
_REQUEST_DUMP = 0x301
_IFA_ADDRESS, _IFA_LOCAL = 1, 2
_HEAD, _ADDRESS, _ATTRIBUTE = struct.Struct("=IHHII"), struct.Struct("=BBBBI"), struct.Struct("=HH")
_GLOBAL = 0


def why_not_ask(interface: str, addresses: list[str]) -> str:
    """Why an interface is asked only if named, else empty."""
    folder = _NET / interface
    if addresses:
        return message("has the address {ip}", ip=addresses[0])
    if (folder / "wireless").exists() or (folder / "phy80211").exists():
        return message("is wireless")
    if (folder / "bridge").exists():
        return message("is a bridge")
    if (folder / "tun_flags").exists():
        return message("is a tunnel")
    # A bridge, bond or VLAN on top of it has the addresses.
    above = sorted(path.name.removeprefix("upper_") for path in folder.glob("upper_*"))
    return message("belongs to {name}", name=above[0]) if above else ""


def used_addresses() -> dict[int, list[str]]:
    """Interface's index → IPv4 and global IPv6 addresses. Raises OSError."""
    found: dict[int, list[str]] = {}
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, 0) as kernel:
        kernel.settimeout(ADDRESSES_S)
        kernel.bind((0, 0))
        size = _HEAD.size + _ADDRESS.size
        kernel.send(_HEAD.pack(size, _GETADDR, _REQUEST_DUMP, 1, 0) + _ADDRESS.pack(0, 0, 0, 0, 0))
        while True:
            data = kernel.recv(1 << 16)
            while len(data) >= _HEAD.size:
                length, kind = _HEAD.unpack_from(data)[:2]
                if kind in (_DONE, _ERROR):
                    return found
                if kind == _NEWADDR:
                    _take(data[_HEAD.size : length], found)
                data = data[length + 3 & ~3 :]


def _take(message: bytes, found: dict[int, list[str]]) -> None:
    family, _, _, scope, index = _ADDRESS.unpack_from(message)
    if family == socket.AF_INET6 and scope != _GLOBAL:
        return
    texts: dict[int, str] = {}
    rest = message[_ADDRESS.size :]
    while len(rest) >= _ATTRIBUTE.size:
        length, kind = _ATTRIBUTE.unpack_from(rest)
        if length < _ATTRIBUTE.size:
            break
        if kind in (_IFA_ADDRESS, _IFA_LOCAL):
            with contextlib.suppress(ValueError):
                texts[kind] = str(ip_address(rest[_ATTRIBUTE.size : length]))
        rest = rest[length + 3 & ~3 :]
    # On a link to one other end, IFA_ADDRESS is the other end's.
    if texts:
        found.setdefault(index, []).append(texts.get(_IFA_LOCAL, texts.get(_IFA_ADDRESS, "")))
