"""The WALT latency timer on a USB serial port."""

from __future__ import annotations

import os

from serial.tools import list_ports

from draglag.messages import message
from draglag_devices.addresses import Address, parse_address
from draglag_devices.discovery import Found
from draglag_devices.source import DeviceError
from draglag_devices.walt.port import RIGHTS_REMEDY
from draglag_devices.walt.protocol import USB_VENDOR
from draglag_devices.walt.source import WaltSource

ROLES = ("walt", "laser")


def open_source(address: Address | str, role: str) -> WaltSource:
    """The WALT at ``serial:PORT[?role=laser|walt][&firmware=any]``, not yet open. Raises DeviceError."""
    parsed = parse_address(address) if isinstance(address, str) else address
    parsed.only("role", "firmware")
    wanted = parsed.choice("role", ROLES, role)
    if wanted != role:
        raise DeviceError(
            parsed.text,
            message("the address says role={said} but is used as {role}", said=wanted, role=role),
            message("write ?role={role}", role=role),
        )
    return WaltSource(parsed, role)


def discover() -> list[Found]:
    """Serial ports of the WALT's USB vendor; nothing is sent."""
    found = []
    for port in sorted(list_ports.comports(), key=lambda port: port.device):
        if port.vid != USB_VENDOR:
            continue
        usable = os.access(port.device, os.R_OK | os.W_OK)
        words = message("{product} (perhaps a WALT)", product=port.product or "USB serial")
        found.append(Found(f"serial:{port.device}", ROLES, words, usable, "" if usable else RIGHTS_REMEDY))
    return found
