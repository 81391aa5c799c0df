"""Devices that are present."""

from __future__ import annotations

import importlib
from collections.abc import Collection
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from draglag.messages import message
from draglag.system.packages import advice
from draglag_devices.addresses import DRIVERS, other_drivers


@dataclass(frozen=True)
class Found:
    """One device; ``remedy``: what makes it ``usable``."""

    address: str
    roles: tuple[str, ...]
    description: str
    usable: bool = True
    remedy: str = ""


@runtime_checkable
class Discovers(Protocol):
    """A driver's module that lists devices; only EtherCAT's gets ``probe``."""

    def discover(self, probe: Collection[str] = ()) -> list[Found]:
        """Devices present."""
        ...


SIMULATED = Found("sim:", ("touch", "laser", "walt"), message("simulated rig (any screen of the presets)"))


def discover(probe: Collection[str] = ()) -> list[Found]:
    """The simulator and each driver's devices; a driver without its package gives a remedy.

    ``probe``: interfaces to ask for EtherCAT devices although in use.
    """
    found = [SIMULATED]
    for scheme, module_name in DRIVERS.items():
        try:
            module = importlib.import_module(module_name)
        except ModuleNotFoundError as missing:
            if missing.name != module_name:
                problem, remedy = advice(missing.name or "")
                found.append(Found(f"{scheme}:", (), problem, False, remedy))
            continue
        if isinstance(module, Discovers):
            found.extend(module.discover(probe) if scheme == "ethercat" else module.discover())
    for scheme, driver in other_drivers().items():
        try:
            if isinstance(driver, Discovers):
                found.extend(driver.discover())
        except Exception as error:  # whatever a stranger's driver does must not hide the others
            problem = message("its driver fails ({kind}: {error})", kind=type(error).__name__, error=error)
            found.append(Found(f"{scheme}:", (), problem, False, message("ask who made its package")))
    return found
