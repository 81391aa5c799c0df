"""Device addresses, ``scheme:target?option=value&…``; the simulator replaces no missing device."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from urllib.parse import parse_qsl

from draglag.messages import message
from draglag_devices.other_packages import Driver, drivers_of_others
from draglag_devices.source import DeviceError

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
    "replay": message("the address names no file"),
    "csv": message("the address names no file"),
    "evdev": message("the address names no device"),
    "ethercat": message("the address names no network interface"),
    "serial": message("the address names no port"),
}
_SERVES = {"sim": ROLES, "replay": ROLES, "csv": ("touch", "laser"), "evdev": ("touch",),
           "ethercat": ("laser",), "serial": ("laser", "walt")}  # fmt: skip

# Drivers of real hardware are imported only when an address asks for them.
DRIVERS = {"evdev": "draglag_devices.evdev_touch", "ethercat": "draglag_devices.ethercat_laser",
            "serial": "draglag_devices.walt"}  # fmt: skip


@dataclass(frozen=True)
class Address:
    """A parsed address."""

    text: str
    scheme: str
    target: str = ""
    options: Mapping[str, str] = field(default_factory=dict)

    def number(self, name: str, default: float | None = None) -> float | None:
        """The option as a number. Raises DeviceError."""
        if name not in self.options:
            return default
        try:
            return float(self.options[name])
        except ValueError:
            raise DeviceError(
                self.text,
                message("option {name}={value} is not a number", name=name, value=self.options[name]),
                message("write e.g. {name}=1", name=name),
            ) from None

    def choice(self, name: str, known: tuple[str, ...], default: str) -> str:
        """The option. Raises DeviceError unless it is ``known``."""
        value = self.options.get(name, default)
        if value not in known:
            raise DeviceError(
                self.text,
                message("option {name}={value} is unknown", name=name, value=value),
                message("use one of: {known}", known=", ".join(known)),
            )
        return value

    def only(self, *names: str) -> None:
        """Raise DeviceError for any other option."""
        for name in self.options:
            if name not in names:
                known = ", ".join(names) if names else "none"
                raise DeviceError(
                    self.text,
                    message("option {name} is unknown here", name=name),
                    message("known options: {options}", options=known),
                )


def parse_address(text: str) -> Address:
    """The parsed address. Raises DeviceError."""
    text = text.strip()
    scheme, colon, rest = text.partition(":")
    if not colon or (scheme not in _SERVES and scheme not in other_drivers()):
        raise DeviceError(
            text or "(empty)",
            "this is not a device address",
            message("known forms: {forms}", forms=" · ".join(known_forms())),
        )
    target, _, query = rest.partition("?")
    _check_target(text, scheme, target)
    try:
        options = dict(parse_qsl(query, keep_blank_values=True, strict_parsing=True)) if query else {}
    except ValueError:
        raise DeviceError(
            text, message("'{query}' is not a list of options", query=query), "write ?name=value&name=value"
        ) from None
    return Address(text, scheme, target, options)


def _check_target(text: str, scheme: str, target: str) -> None:
    if scheme in _NEEDS_TARGET and not target:
        form = next(form for form in KNOWN_FORMS if form.startswith(scheme))
        raise DeviceError(
            text,
            _NEEDS_TARGET[scheme],
            message("write {form}", form=form),
        )
    if scheme in DRIVERS and target.startswith(":"):
        raise DeviceError(
            text,
            "the address has one colon too many",
            message("write {scheme}:{target}", scheme=scheme, target=text.partition(":")[2].lstrip(":")),
        )
    if scheme == "sim" and target:
        raise DeviceError(
            text,
            message("'{target}' means nothing to the simulator", target=target),
            "write sim: or sim:?seed=3&speed=fast",
        )


def other_drivers() -> dict[str, Driver]:
    """Scheme → driver of other packages."""
    return drivers_of_others(_SERVES, ROLES)


def known_forms() -> tuple[str, ...]:
    """Every form of address, other packages' included."""
    return (*KNOWN_FORMS, *(driver.FORM for driver in other_drivers().values()))


def roles_of(scheme: str) -> tuple[str, ...]:
    """Roles of a known scheme."""
    return _SERVES[scheme] if scheme in _SERVES else tuple(other_drivers()[scheme].ROLES)
