"""Discovery: interfaces on which EtherCAT devices answer, and wired ones that could be used for it."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

from draglag_devices.discovery import Found
from draglag_devices.ethercat_laser.helper import command

_PATIENCE_S = 10.0


def look_for_buses() -> list[Found]:
    """One entry per interface of interest, with the remedy where it is not usable yet."""
    try:
        done = subprocess.run(
            command("--probe"), stdin=subprocess.DEVNULL, capture_output=True, timeout=_PATIENCE_S, check=False
        )
        interfaces = json.loads(done.stdout.splitlines()[-1])["found"]
    except (OSError, ValueError, LookupError, subprocess.TimeoutExpired):
        return []
    return [entry for interface in interfaces if (entry := _entry(interface)) is not None]


def _entry(seen: dict[str, Any]) -> Found | None:
    name = seen["name"]
    address = f"ethercat:{name}?channel=1"
    if seen["slaves"]:
        return Found(address, ("laser",), f"EtherCAT bus on {name}, {seen['slaves']} devices")
    if seen["busy"]:
        remedy = "close the other EtherCAT program"
        return Found(address, ("laser",), f"EtherCAT bus on {name}, in use", False, remedy)
    # Office networks, bridges and tunnels are nobody's field bus.
    if seen["has_ip"] or not Path(f"/sys/class/net/{name}/device").exists():
        return None
    if not seen["up"]:
        problem, remedy = "switched off", f"sudo ip link set {name} up"
    elif not seen["carrier"]:
        problem, remedy = "no carrier", "plug in the cable, switch on the coupler"
    elif not seen["rights"]:
        problem, remedy = "no rights to look", "sudo packaging/ethercat/install.sh"
    else:
        problem, remedy = "no EtherCAT device answers", "plug the cable into the coupler's IN port, switch it on"
    return Found(address, ("laser",), f"network interface {name}: {problem}", False, remedy)
