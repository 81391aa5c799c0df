"""Device schemes of other packages: entry points ``draglag.sources`` (docs/sources.md)."""

from __future__ import annotations

import re
from collections.abc import Collection
from functools import cache
from typing import TYPE_CHECKING, Protocol, cast

from draglag.system.plugins import brought

if TYPE_CHECKING:
    from draglag_devices.addresses import Address
    from draglag_devices.source import Source

GROUP = "draglag.sources"


class Driver(Protocol):
    """The module of a scheme, perhaps with ``discover()``."""

    ROLES: tuple[str, ...]
    """Roles of its devices: "touch", "laser", "walt"."""

    FORM: str
    """Form of an address: ``scheme:TARGET?option=1``."""

    def open_source(self, address: Address, role: str) -> Source:
        """The source, not yet open. Raises DeviceError."""
        ...


def drivers_of_others(taken: Collection[str], roles: Collection[str]) -> dict[str, Driver]:
    """Scheme → driver, without ``taken`` schemes; warns of unusable ones."""
    return _drivers(frozenset(taken), frozenset(roles))


@cache
def _drivers(taken: frozenset[str], roles: frozenset[str]) -> dict[str, Driver]:
    def problem_of(scheme: str, module: object) -> str:
        if not re.fullmatch(r"[a-z][a-z0-9-]*", scheme):
            return "its scheme is not of lower-case letters, digits and dashes"
        if scheme in taken:
            return "its scheme is taken"
        missing = [name for name in ("ROLES", "FORM", "open_source") if not getattr(module, name, None)]
        if missing:
            return f"it has no {missing[0]}"
        driver = cast(Driver, module)
        if strange := set(driver.ROLES) - roles:
            return f"there is no role {sorted(strange)[0]!r}"
        return "" if driver.FORM.startswith(f"{scheme}:") else f"its FORM does not begin with {scheme}:"

    return {scheme: cast(Driver, module) for scheme, module in brought(GROUP, "source", problem_of)}
