"""Addresses of devices: one form everywhere, ``scheme:target?option=value&option=value``.

The simulator is chosen by its address only, never because a real device or its driver is missing.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, cast
from urllib.parse import parse_qsl

from draglag.packages import advice
from draglag_devices.other_packages import Driver, drivers_of_others
from draglag_devices.source import DeviceError, Source

if TYPE_CHECKING:
    from draglag_devices.stage import Stage

ROLES = ("touch", "laser", "walt")

KNOWN_FORMS = (
    "sim:",
    "replay:FILE",
    "csv:FILE",
    "evdev:/dev/input/eventN",
    "ethercat:IFACE?channel=1",
    "serial:/dev/ttyACM0",
)

_NEEDS_TARGET = {
    "replay": "a file",
    "csv": "a file",
    "evdev": "a device",
    "ethercat": "a network interface",
    "serial": "a port",
}
_SERVES = {"sim": ROLES, "replay": ROLES, "csv": ("touch", "laser"), "evdev": ("touch",),
           "ethercat": ("laser",), "serial": ("laser", "walt")}  # fmt: skip

# Drivers of real hardware are imported only when an address asks for them.
DRIVERS = {"evdev": "draglag_devices.evdev_touch", "ethercat": "draglag_devices.ethercat_laser",
            "serial": "draglag_devices.walt"}  # fmt: skip


@dataclass(frozen=True)
class Address:
    """A parsed address. ``target`` is what stands between the scheme and the options."""

    text: str
    scheme: str
    target: str = ""
    options: Mapping[str, str] = field(default_factory=dict)

    def number(self, name: str, default: float | None = None) -> float | None:
        """The option as a number, or the default. Raises DeviceError where it is not one."""
        if name not in self.options:
            return default
        try:
            return float(self.options[name])
        except ValueError:
            raise DeviceError(
                self.text, f"option {name}={self.options[name]} is not a number", f"write e.g. {name}=1"
            ) from None

    def choice(self, name: str, known: tuple[str, ...], default: str) -> str:
        """The option as one of the known words. Raises DeviceError on any other."""
        value = self.options.get(name, default)
        if value not in known:
            raise DeviceError(self.text, f"option {name}={value} is unknown", f"use one of: {', '.join(known)}")
        return value

    def only(self, *names: str) -> None:
        """Refuse options that nobody reads (a typing slip must not pass silently). Raises DeviceError."""
        for name in self.options:
            if name not in names:
                known = ", ".join(names) if names else "none"
                raise DeviceError(self.text, f"option {name} is unknown here", f"known options: {known}")


def parse_address(text: str) -> Address:
    """Parse ``scheme:target?options``. Raises DeviceError that lists the known forms."""
    text = text.strip()
    scheme, colon, rest = text.partition(":")
    if not colon or (scheme not in _SERVES and scheme not in other_drivers()):
        raise DeviceError(
            text or "(empty)", "this is not a device address", f"known forms: {' · '.join(known_forms())}"
        )
    target, _, query = rest.partition("?")
    if scheme in _NEEDS_TARGET and not target:
        form = next(form for form in KNOWN_FORMS if form.startswith(scheme))
        raise DeviceError(text, f"the address names no {_NEEDS_TARGET[scheme].split(' ', 1)[1]}", f"write {form}")
    if scheme in DRIVERS and target.startswith(":"):
        raise DeviceError(text, "the address has one colon too many", f"write {scheme}:{rest.lstrip(':')}")
    if scheme == "sim" and target:
        raise DeviceError(text, f"'{target}' means nothing to the simulator", "write sim: or sim:?seed=3&speed=fast")
    try:
        options = dict(parse_qsl(query, keep_blank_values=True, strict_parsing=True)) if query else {}
    except ValueError:
        raise DeviceError(text, f"'{query}' is not a list of options", "write ?name=value&name=value") from None
    return Address(text, scheme, target, options)


def open_source(address: str | Address, role: str, stage: Stage | None = None) -> Source:
    """The source an address stands for; it is made here and claimed by its own ``open()``.

    Args:
        address: the address, as text or parsed.
        role: "touch" | "laser" | "walt".
        stage: what the sources of one session share; a new one if None.

    Raises:
        DeviceError: unknown address, a role the scheme cannot serve, or a driver this version lacks.
    """
    parsed = parse_address(address) if isinstance(address, str) else address
    if role not in ROLES:
        raise DeviceError(parsed.text, f"there is no role '{role}'", f"roles are {', '.join(ROLES)}")
    if role not in _roles(parsed.scheme):
        fitting = " · ".join(form for form in known_forms() if role in _roles(form.split(":", 1)[0]))
        raise DeviceError(parsed.text, f"cannot serve as {role}", f"for {role} use one of: {fitting}")
    if parsed.scheme == "sim":
        from draglag_devices.sim.sources import simulated_source

        return simulated_source(stage or _new_stage(), role, parsed)
    if parsed.scheme in ("replay", "csv"):
        from draglag_devices.replay import replay_source

        return replay_source(stage or _new_stage(), role, parsed)
    if parsed.scheme not in DRIVERS:
        return other_drivers()[parsed.scheme].open_source(parsed, role)
    return _driver_source(parsed, role)


def other_drivers() -> dict[str, Driver]:
    """Scheme → driver of other packages (docs/sources.md)."""
    return drivers_of_others(_SERVES, ROLES)


def known_forms() -> tuple[str, ...]:
    """Every form of address that can be used here."""
    return (*KNOWN_FORMS, *(driver.FORM for driver in other_drivers().values()))


def _roles(scheme: str) -> tuple[str, ...]:
    return _SERVES[scheme] if scheme in _SERVES else tuple(other_drivers()[scheme].ROLES)


def _new_stage() -> Stage:
    from draglag_devices.stage import Stage

    return Stage()


def _driver_source(address: Address, role: str) -> Source:
    module_name = DRIVERS[address.scheme]
    try:
        module = importlib.import_module(module_name)
    except ModuleNotFoundError as missing:
        if missing.name == module_name:
            raise DeviceError(
                address.text,
                f"the driver of {address.scheme} devices is not in this version",
                "use sim:, replay:FILE or csv:FILE, or install a newer version",
            ) from None
        raise DeviceError(address.text, *advice(missing.name or "")) from None
    return cast(Source, module.open_source(address, role))
