"""Interfaces on which EtherCAT devices answer."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Collection
from typing import Any

from draglag.errors import cause
from draglag.messages import Message, chained, joined, message, phrase, unpacked
from draglag_devices.discovery import Found
from draglag_devices.ethercat_laser.helper import LAUNCHERS, command
from draglag_devices.ethercat_laser.kinds import BECKHOFF, COUPLERS, EL1252
from draglag_devices.ethercat_laser.preflight import INSTALL
from draglag_devices.ethercat_laser.probe import NOT_ALLOWED, scan_bus
from draglag_devices.ethercat_laser.waits import DISCOVERY_S


def find_buses(asked: Collection[str] = ()) -> list[Found]:
    """One entry per Ethernet interface; those in other use are asked only if in ``asked``."""
    why, interfaces = _probe(asked)
    return [_entry(interface, why) for interface in interfaces]


def _probe(asked: Collection[str]) -> tuple[str, list[dict[str, Any]]]:
    reason = ""
    try:
        done = subprocess.run(
            command("--probe", *asked), stdin=subprocess.DEVNULL, capture_output=True, timeout=DISCOVERY_S, check=False
        )
        reason = (done.stderr.decode(errors="replace").strip().splitlines() or [f"exit {done.returncode}"])[-1]
        return "", list(json.loads(done.stdout.splitlines()[-1], object_hook=unpacked)["found"])
    except subprocess.TimeoutExpired:
        reason = message("no answer within {seconds:.0f} s", seconds=DISCOVERY_S)
    except OSError as error:
        reason = cause(error)
    except (ValueError, LookupError, TypeError):
        pass
    return message("the EtherCAT helper failed ({why})", why=reason), scan_bus(asked, send=False)


def _entry(seen: dict[str, Any], helper: str) -> Found:
    name = seen["name"]
    address = f"ethercat:{name}?channel=1"
    if seen["slaves"]:
        return _bus(address, seen)
    if seen["busy"]:
        remedy = message("close the other EtherCAT program")
        return Found(address, ("laser",), message("EtherCAT bus on {name}, in use", name=name), False, remedy)
    install = f"{INSTALL} {name}"
    if seen["left_alone"]:
        return _left_alone(address, name, seen["left_alone"], install)
    if not seen["up"]:
        problem, remedy = (
            message("switched off"),
            message("switch it on as administrator: {command}", command=f"sudo ip link set {name} up"),
        )
    elif not seen["carrier"]:
        problem, remedy = message("no carrier"), message("plug in the cable, switch on the coupler")
    elif helper:
        problem, remedy = (
            phrase(helper),
            message("install the helper again, as administrator: {command}", command=install),
        )
    elif not seen["rights"]:
        installed = any(launcher.exists() and not os.access(launcher, os.X_OK) for launcher in LAUNCHERS)
        group = message("as administrator: {command}; then log in again", command="sudo usermod -aG draglag $USER")
        problem, remedy = (
            message("no rights to look"),
            group if installed else message("install the helper once as administrator: {command}", command=install),
        )
    else:
        problem = message("no EtherCAT device answers")
        remedy = message("plug the cable into the coupler's IN port, switch it on")
    return Found(address, ("laser",), _not_usable(name, problem), False, remedy)


def _left_alone(address: str, name: str, why: str, install: str) -> Found:
    if why == NOT_ALLOWED:
        remedy = message("install it again for this interface, as administrator: {command}", command=install)
        return Found(address, ("laser",), _not_usable(name, NOT_ALLOWED), False, remedy)
    remedy = message("to look there: draglag devices --probe {name}", name=name)
    # What is no Ethernet cable of this computer is nothing to choose.
    roles = ("laser",) if why.startswith("has ") else ()
    return Found(address, roles, _not_usable(name, why), False, remedy)


def _not_usable(name: str, problem: str) -> Message:
    return message("network interface {name}: {problem}", name=name, problem=phrase(problem))


def _bus(address: str, seen: dict[str, Any]) -> Found:
    name, slaves = seen["name"], seen["slaves"]
    kinds = [(int(vendor), int(product)) for vendor, product in seen["kinds"]]
    places = [place for place, kind in enumerate(kinds, 1) if kind == (BECKHOFF, EL1252)]
    words = message("EtherCAT bus on {name}, {n} devices", name=name, n=slaves)
    if len(places) > 1:
        options = chained("{before} or {next}", (f"&position={place}" for place in places))
        remedy = message("say which in the laser's address: {options}", options=options)
        words = message("{bus}, {k} of them EL1252", bus=words, k=len(places))
        return Found(address, ("laser",), words, False, remedy)
    if places and any((BECKHOFF, coupler) in kinds for coupler in COUPLERS):
        return Found(address, ("laser",), words)
    if any(vendor == 0 or product == 0 for vendor, product in kinds) or len(kinds) < slaves:
        remedy = message("check the cable and the supply of the coupler")
        words = message("{bus}, of which some do not say what they are", bus=words)
        return Found(address, ("laser",), words, False, remedy)
    listed = joined(
        ", ",
        (
            message("vendor {vendor} product {product}", vendor=f"0x{vendor:X}", product=f"0x{product:08X}")
            for vendor, product in kinds
        ),
    )
    remedy = message("connect the EK1101 (or an EK1100) with the EL1252, or choose the interface they are on")
    words = message("{bus}, not an EK1101 with an EL1252: {found}", bus=words, found=listed)
    return Found(address, ("laser",), words, False, remedy)
