"""From addresses to a session's sources on one clock."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from draglag.messages import message
from draglag.recording import Screen
from draglag.touch_events.frames import Mapping2D
from draglag_devices.addresses import Address, parse_address
from draglag_devices.opening import open_source
from draglag_devices.source import AcceptsCalibration, AcceptsPanel, DeviceError, Source
from draglag_devices.stage import Stage
from draglag_devices.timebase import HostTime, SteppedTime

_SIMULATED = ("sim", "replay", "csv")


@dataclass(frozen=True)
class Rig:
    """Sources, not yet open, and what they share."""

    sources: tuple[Source, ...]
    stage: Stage


def make_rig(
    addresses: Mapping[str, str], screen_name: str = "screen-1", seed: int = 0, fast: bool | None = None
) -> Rig:
    """Sources by role. Raises DeviceError, also where addresses contradict each other.

    Args:
        addresses: role → address.
        screen_name, seed: of the simulated world, unless an address gives them.
        fast: not in real time; None: by ``?speed=``.
    """
    parsed = {role: parse_address(text) for role, text in addresses.items()}
    simulated = [address for address in parsed.values() if address.scheme == "sim"]
    stage = Stage(
        SteppedTime() if _runs_fast(parsed, fast) else HostTime(),
        _agreed(simulated, "screen", screen_name),
        _seed(simulated, seed),
    )
    return Rig(tuple(open_source(address, role, stage) for role, address in parsed.items()), stage)


def _runs_fast(parsed: Mapping[str, Address], fast: bool | None) -> bool:
    speeds = {
        role: address.choice("speed", ("real", "fast"), "fast" if fast else "real")
        for role, address in parsed.items()
        if address.scheme in _SIMULATED
    }
    if fast is False:
        speeds = dict.fromkeys(speeds, "real")
    hardware = [address.text for address in parsed.values() if address.scheme not in _SIMULATED]
    run_fast = "fast" in speeds.values()
    if run_fast and hardware:
        raise DeviceError(hardware[0], "a real device cannot run faster than time", "omit --fast and speed=fast")
    if run_fast and "real" in speeds.values():
        slow = next(parsed[role].text for role, speed in speeds.items() if speed == "real")
        raise DeviceError(slow, "the other sources run fast and this one in real time", "give all the same speed")
    return run_fast


def give_panel(sources: Iterable[Source], screen: Screen) -> None:
    """Give the panel's size to sources; before ``open``."""
    for source in sources:
        if isinstance(source, AcceptsPanel):
            source.use_panel(screen.width_mm, screen.height_mm)


def give_calibration(rig: Rig, mapping: Mapping2D, device: str, rms_mm: float) -> bool:
    """Whether a source accepts the mapping; before ``open``.

    Touchscreens of another name than ``device`` then refuse to open.
    """
    accepting = [source for source in rig.sources if isinstance(source, AcceptsCalibration)]
    for source in accepting:
        source.use_calibration(mapping, device, rms_mm)
    return bool(accepting)


def _agreed(addresses: list[Address], option: str, default: str) -> str:
    given = {address.options[option] for address in addresses if option in address.options}
    if len(given) > 1:
        raise DeviceError(
            addresses[0].text,
            message("simulated sources differ in {option} ({given})", option=option, given=", ".join(sorted(given))),
            "give all the same",
        )
    return given.pop() if given else default


def _seed(addresses: list[Address], default: int) -> int:
    text = _agreed(addresses, "seed", str(default))
    number = next((a.number("seed") for a in addresses if "seed" in a.options), float(default))
    if number is None or number < 0 or not math.isfinite(number) or number != int(number):
        raise DeviceError(
            addresses[0].text, message("seed={text} is not a whole number", text=text), "write e.g. seed=3"
        )
    return int(number)
