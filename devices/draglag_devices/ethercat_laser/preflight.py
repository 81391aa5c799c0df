"""Checks before opening the bus: SOEM gives one error for most causes."""

from __future__ import annotations

import array
import contextlib
import fcntl
import socket
import struct
import time
from pathlib import Path

from draglag.messages import message
from draglag_devices.ethercat_laser.refusal import Refusal
from draglag_devices.ethercat_laser.waits import CLAIM_PAUSE_S

_SIOCGIFFLAGS, _SIOCETHTOOL, _ETHTOOL_GLINK = 0x8913, 0x8946, 0x0A
_IFF_UP, _IFF_RUNNING = 0x1, 0x40
_CAP_NET_ADMIN, _CAP_NET_RAW = 1 << 12, 1 << 13
ETHERTYPE = 0x88A4
# The interfaces that the bus is on follow. The first is the Debian package's, the other is typed in a checkout.
_OF_THE_PACKAGE = Path("/usr/sbin/draglag-ethercat-setup")
INSTALL = f"sudo {_OF_THE_PACKAGE.name}" if _OF_THE_PACKAGE.exists() else "sudo ./run install"


def check_interface(interface: str) -> None:
    """Raises Refusal: absent, switched off, no carrier."""
    try:
        socket.if_nametoindex(interface)
    except OSError:
        others = ", ".join(name for _, name in socket.if_nameindex() if name != "lo") or message("none")
        raise Refusal(
            "no_interface",
            message("there is no network interface called {name}", name=interface),
            message("choose the one that the coupler is plugged into; this computer has: {others}", others=others),
        ) from None
    flags, carrier = link_state(interface)
    if not flags & _IFF_UP:
        raise Refusal(
            "down",
            message("the network interface {name} is switched off", name=interface),
            message("switch it on as administrator: {command}", command=f"sudo ip link set {interface} up"),
        )
    if not carrier:
        raise Refusal(
            "no_carrier",
            message(
                "the network interface {name} has no carrier: the cable is unplugged or the coupler has no power",
                name=interface,
            ),
            "plug the cable into the IN port of the EK1101 and switch on its 24 V supply",
        )


def link_state(interface: str) -> tuple[int, bool]:
    """Flags and carrier; by a socket, as /sys may show another network namespace. Raises OSError."""
    request = interface.encode().ljust(16, b"\0")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as control:
        flags = struct.unpack_from("<H", fcntl.ioctl(control, _SIOCGIFFLAGS, request + bytes(24)), 16)[0]
        answer = array.array("I", [_ETHTOOL_GLINK, 0])
        try:
            fcntl.ioctl(control, _SIOCETHTOOL, request + struct.pack("P16x", answer.buffer_info()[0]))
            carrier = bool(answer[1])
        except OSError:  # a driver without ethtool
            carrier = bool(flags & _IFF_RUNNING)
    return flags, carrier


def link_trouble(interface: str) -> str:
    """Why an interface reaches nothing, else empty."""
    try:
        flags, carrier = link_state(interface)
    except OSError:
        return message(
            "the network interface {name} is gone: its adapter was unplugged or it was deleted", name=interface
        )
    if not flags & _IFF_UP:
        command = f"sudo ip link set {interface} up"
        return message(
            "the network interface {name} was switched off (switch it on as administrator: {command})",
            name=interface,
            command=command,
        )
    return "" if carrier else message("the cable on {name} is unplugged or the other end is off", name=interface)


def has_rights() -> bool:
    """Whether this process may send raw frames (CAP_NET_RAW, CAP_NET_ADMIN)."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("CapEff:"):
            capabilities = int(line.split()[1], 16)
            return bool(capabilities & _CAP_NET_RAW) and bool(capabilities & _CAP_NET_ADMIN)
    return False


def check_rights(interface: str) -> None:
    """Raises Refusal without ``has_rights``."""
    if not has_rights():
        raise Refusal(
            "no_rights",
            "this account has no right to send EtherCAT frames (CAP_NET_RAW and CAP_NET_ADMIN)",
            message("install the helper once as administrator: {command}", command=f"{INSTALL} {interface}"),
        )


def other_master(interface: str) -> bool:
    """Whether any program listens for EtherCAT frames there."""
    with contextlib.suppress(OSError):
        index = socket.if_nametoindex(interface)
        for line in Path("/proc/self/net/packet").read_text().splitlines()[1:]:
            columns = line.split()
            if int(columns[3], 16) == ETHERTYPE and int(columns[4]) == index:
                return True
    return False


def claim(interface: str, patience_s: float = 0.0) -> socket.socket:
    """A lock against a second master. Raises Refusal if in use after ``patience_s``.

    An abstract socket address belongs to the network namespace and ends with the process.
    """
    until = time.monotonic() + patience_s
    while True:
        lock = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        with contextlib.suppress(OSError):
            lock.bind(f"\0draglag-ethercat-{interface}")
            if not other_master(interface):
                return lock
        lock.close()
        if time.monotonic() >= until:
            raise Refusal(
                "in_use",
                message("the EtherCAT bus on {name} is in use by another program", name=interface),
                "close the other program (a second draglag, TwinCAT, a SOEM tool) and try again",
            )
        time.sleep(CLAIM_PAUSE_S)
