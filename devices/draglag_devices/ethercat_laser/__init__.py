"""The laser sensor on an EtherCAT terminal: ``ethercat:IFACE?channel=1``, EK1101 (or EK1100) + EL1252 through pysoem.

A small process of its own (``master``) runs the bus at 1 kHz and holds the only privileges; ``source`` starts it
and reads it. Nothing is imported here, so that the process stays small.
"""

from __future__ import annotations

import sys
from collections.abc import Collection
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from draglag_devices.addresses import Address
    from draglag_devices.discovery import Found
    from draglag_devices.source import Source


def open_source(address: Address, role: str) -> Source:
    """The laser at an address; claimed by its own ``open()``. Raises DeviceError on options that make no sense."""
    if sys.platform != "linux":
        from draglag_devices.source import DeviceError

        raise DeviceError(address.text, "EtherCAT works on Linux only", "record on a Linux computer")
    from draglag_devices.ethercat_laser.source import ethercat_source

    return ethercat_source(address, role)


def discover(asked: Collection[str] = ()) -> list[Found]:
    """Ethernet interfaces, and on which of them EtherCAT devices answer.

    Those that others use are not asked unless ``asked`` names them.
    """
    if sys.platform != "linux":
        return []
    from draglag_devices.ethercat_laser.finding import find_buses

    return find_buses(asked)
