"""``draglag devices``."""

from __future__ import annotations

import json
import socket

import click

from draglag.errors import DataError
from draglag.messages import message
from draglag_devices.addresses import known_forms
from draglag_devices.discovery import Found, discover


@click.command("devices")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@click.option("--probe", multiple=True, metavar="IFACE", help="Ask this network interface for EtherCAT devices, too; "
              "may be repeated.")  # fmt: skip
def devices(as_json: bool, probe: tuple[str, ...]) -> None:
    """List devices that can be measured with, and what to do about those that cannot.

    EtherCAT devices are looked for by broadcast, on wired interfaces without an IP address only; --probe asks others.

    \b
    Example:
        draglag devices
        draglag devices --probe eno1
    """
    _check(probe)
    found = discover(probe)
    if as_json:
        rows = [{"address": f.address, "roles": list(f.roles), "description": f.description,
                 "usable": f.usable, "remedy": f.remedy} for f in found]  # fmt: skip
        click.echo(json.dumps({"devices": rows}))
        return
    width = max(len(f.address) for f in found)
    for device in found:
        click.echo(_line(device, width))
    click.echo(f"\nAddresses: {' · '.join(known_forms())}")


def _check(interfaces: tuple[str, ...]) -> None:
    known = [name for _, name in socket.if_nameindex()]
    for interface in interfaces:
        if interface not in known:
            others = ", ".join(name for name in known if name != "lo") or "none"
            raise DataError(
                message("there is no network interface called {name}", name=interface),
                message("this computer has: {others}", others=others),
            )


def _line(device: Found, width: int) -> str:
    roles = ", ".join(device.roles) or "—"
    state = "ready" if device.usable else "not usable"
    line = f"{device.address:<{width}}  {roles:<18}  {state:<10}  {device.description}"
    return line + (f"\n{'':<{width}}  → {device.remedy}" if device.remedy else "")
