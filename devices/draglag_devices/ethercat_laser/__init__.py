"""The laser sensor on an EtherCAT terminal EL1252. No imports here: they would be in the privileged process."""

from __future__ import annotations

import sys
from collections.abc import Collection
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from draglag_devices.addresses import Address
    from draglag_devices.discovery import Found
    from draglag_devices.source import Source


def open_source(address: Address, role: str) -> Source:
    """The laser at an address, not yet open. Raises DeviceError."""
    if sys.platform != "linux":
        from draglag_devices.source import DeviceError

        raise DeviceError(address.text, "EtherCAT works on Linux only", "record on a Linux computer")
    from draglag_devices.ethercat_laser.source import ethercat_source

    return ethercat_source(address, role)


def discover(asked: Collection[str] = ()) -> list[Found]:
    """As ``finding.find_buses``."""
    if sys.platform != "linux":
        return []
    from draglag_devices.ethercat_laser.finding import find_buses

    return find_buses(asked)
