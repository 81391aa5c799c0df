"""From an address to its source."""

from __future__ import annotations

import importlib
from typing import cast

from draglag.messages import message
from draglag.system.packages import advice
from draglag_devices.addresses import DRIVERS, ROLES, Address, known_forms, other_drivers, parse_address, roles_of
from draglag_devices.replay import replay_source
from draglag_devices.sim.sources import simulated_source
from draglag_devices.source import DeviceError, Source
from draglag_devices.stage import Stage


def open_source(address: str | Address, role: str, stage: Stage | None = None) -> Source:
    """The source at an address, not yet open. Raises DeviceError.

    ``role``: "touch", "laser" or "walt". ``stage``: shared by a session's sources.
    """
    parsed = parse_address(address) if isinstance(address, str) else address
    if role not in ROLES:
        raise DeviceError(
            parsed.text,
            message("there is no role '{role}'", role=role),
            message("roles are {roles}", roles=", ".join(ROLES)),
        )
    if role not in roles_of(parsed.scheme):
        fitting = " · ".join(form for form in known_forms() if role in roles_of(form.split(":", 1)[0]))
        raise DeviceError(
            parsed.text,
            message("cannot serve as {role}", role=role),
            message("for {role} use one of: {forms}", role=role, forms=fitting),
        )
    if parsed.scheme == "sim":
        return simulated_source(stage or Stage(), role, parsed)
    if parsed.scheme in ("replay", "csv"):
        return replay_source(stage or Stage(), role, parsed)
    if parsed.scheme not in DRIVERS:
        return other_drivers()[parsed.scheme].open_source(parsed, role)
    return _driver_source(parsed, role)


def _driver_source(address: Address, role: str) -> Source:
    module_name = DRIVERS[address.scheme]
    try:
        module = importlib.import_module(module_name)
    except ModuleNotFoundError as missing:
        if missing.name == module_name:
            raise DeviceError(
                address.text,
                message("the driver of {scheme} devices is not in this version", scheme=address.scheme),
                "use sim:, replay:FILE or csv:FILE, or install a newer version",
            ) from None
        raise DeviceError(address.text, *advice(missing.name or "")) from None
    return cast(Source, module.open_source(address, role))
