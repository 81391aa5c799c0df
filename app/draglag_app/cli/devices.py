"""``draglag devices``: what is there, with rights, and what to do when something is missing."""

from __future__ import annotations

import json

import click

from draglag_devices.addresses import KNOWN_FORMS
from draglag_devices.discovery import Found, discover


@click.command("devices")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def devices(as_json: bool) -> None:
    """List devices that can be measured with, and what to do about those that cannot.

    \b
    Example:
        draglag devices
    """
    found = discover()
    if as_json:
        rows = [{"address": f.address, "roles": list(f.roles), "description": f.description,
                 "usable": f.usable, "remedy": f.remedy} for f in found]  # fmt: skip
        click.echo(json.dumps({"devices": rows}))
        return
    width = max(len(f.address) for f in found)
    for device in found:
        click.echo(_line(device, width))
    click.echo(f"\nAddresses: {' · '.join(KNOWN_FORMS)}")


def _line(device: Found, width: int) -> str:
    roles = ", ".join(device.roles) or "—"
    state = "ready" if device.usable else "not usable"
    line = f"{device.address:<{width}}  {roles:<18}  {state:<10}  {device.description}"
    return line + (f"\n{'':<{width}}  → {device.remedy}" if device.remedy else "")
