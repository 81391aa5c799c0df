"""Discovery: interfaces on which EtherCAT devices answer, and why the others do not serve."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Collection
from typing import Any

from draglag_devices.discovery import Found
from draglag_devices.ethercat_laser.helper import LAUNCHERS, command
from draglag_devices.ethercat_laser.kinds import BECKHOFF, COUPLERS, EL1252
from draglag_devices.ethercat_laser.preflight import INSTALL
from draglag_devices.ethercat_laser.probe import NOT_ALLOWED, scan_bus

_TIMEOUT_S = 10.0


def find_buses(asked: Collection[str] = ()) -> list[Found]:
    """One entry an Ethernet interface, with the reason and the remedy where it is not usable.

    Interfaces that others use (with an address, wireless, …) are asked only where ``asked`` names them.
    """
    why, interfaces = _probe(asked)
    return [_entry(interface, why) for interface in interfaces]


def _probe(asked: Collection[str]) -> tuple[str, list[dict[str, Any]]]:
    """Why the helper failed, or an empty string, and what it saw; without it, what needs no rights to see."""
    reason = ""
    try:
        done = subprocess.run(
            command("--probe", *asked), stdin=subprocess.DEVNULL, capture_output=True, timeout=_TIMEOUT_S, check=False
        )
        reason = (done.stderr.decode(errors="replace").strip().splitlines() or [f"exit {done.returncode}"])[-1]
        return "", list(json.loads(done.stdout.splitlines()[-1])["found"])
    except subprocess.TimeoutExpired:
        reason = f"no answer within {_TIMEOUT_S:.0f} s"
    except OSError as error:
        reason = error.strerror or str(error)
    except (ValueError, LookupError, TypeError):
        pass
    return f"the EtherCAT helper failed ({reason})", scan_bus(asked, send=False)


def _entry(seen: dict[str, Any], helper: str) -> Found:
    name = seen["name"]
    address = f"ethercat:{name}?channel=1"
    if seen["slaves"]:
        return _bus(address, seen)
    if seen["busy"]:
        remedy = "close the other EtherCAT program"
        return Found(address, ("laser",), f"EtherCAT bus on {name}, in use", False, remedy)
    install = f"{INSTALL} {name}"
    if seen["left_alone"] == NOT_ALLOWED:
        remedy = f"install it again for this interface: {install}"
        return Found(address, ("laser",), f"network interface {name}: {NOT_ALLOWED}", False, remedy)
    if seen["left_alone"]:
        remedy = f"to look there: draglag devices --probe {name}"
        # What is no Ethernet cable of this computer is nothing to choose.
        roles = ("laser",) if seen["left_alone"].startswith("has ") else ()
        return Found(address, roles, f"network interface {name}: {seen['left_alone']}", False, remedy)
    if not seen["up"]:
        problem, remedy = "switched off", f"sudo ip link set {name} up"
    elif not seen["carrier"]:
        problem, remedy = "no carrier", "plug in the cable, switch on the coupler"
    elif helper:
        problem, remedy = helper, f"install the helper again: {install}"
    elif not seen["rights"]:
        installed = any(launcher.exists() and not os.access(launcher, os.X_OK) for launcher in LAUNCHERS)
        problem, remedy = (
            "no rights to look",
            "sudo usermod -aG draglag $USER, then log in again" if installed else install,
        )
    else:
        problem, remedy = "no EtherCAT device answers", "plug the cable into the coupler's IN port, switch it on"
    return Found(address, ("laser",), f"network interface {name}: {problem}", False, remedy)


def _bus(address: str, seen: dict[str, Any]) -> Found:
    name, slaves = seen["name"], seen["slaves"]
    kinds = [(int(vendor), int(product)) for vendor, product in seen["kinds"]]
    places = [place for place, kind in enumerate(kinds, 1) if kind == (BECKHOFF, EL1252)]
    words = f"EtherCAT bus on {name}, {slaves} devices"
    if len(places) > 1:
        remedy = f"say which in the laser's address: &position={' or &position='.join(map(str, places))}"
        return Found(address, ("laser",), f"{words}, {len(places)} of them EL1252", False, remedy)
    if places and any((BECKHOFF, coupler) in kinds for coupler in COUPLERS):
        return Found(address, ("laser",), words)
    if any(vendor == 0 or product == 0 for vendor, product in kinds) or len(kinds) < slaves:
        remedy = "check the cable and the supply of the coupler"
        return Found(address, ("laser",), f"{words}, of which some do not say what they are", False, remedy)
    listed = ", ".join(f"vendor 0x{vendor:X} product 0x{product:08X}" for vendor, product in kinds)
    remedy = "connect the EK1101 (or an EK1100) with the EL1252, or choose the interface they are on"
    return Found(address, ("laser",), f"{words}, not an EK1101 with an EL1252: {listed}", False, remedy)
