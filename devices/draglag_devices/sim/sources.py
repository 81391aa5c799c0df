"""Simulated touch, laser and WALT of one world."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

from draglag.messages import message
from draglag.touch_events.frames import Mapping2D
from draglag_devices.addresses import Address
from draglag_devices.sim.world import World
from draglag_devices.source import SourceInfo
from draglag_devices.stage import Stage
from draglag_devices.timeline import TimelineSource

OPTIONS = ("speed", "screen", "seed")


class SimulatedTouch(TimelineSource):
    """The simulated digitiser."""

    def __init__(self, address: str, stage: Stage, world: World, describe: Callable[[], SourceInfo]) -> None:
        super().__init__(address, "touch", stage.time_base, world.timelines["touch"], describe)
        self._world = world

    def use_calibration(self, mapping: Mapping2D, device: str, rms_mm: float) -> None:
        """As ``AcceptsCalibration``; ``device`` is not compared."""
        self._world.use_calibration(mapping)


def shared_world(stage: Stage) -> World:
    """The session's only simulated world."""
    return cast(
        World,
        stage.player("sim", lambda: World(stage.screen_name, stage.seed, stage.time_base.now())),
    )


def simulated_source(stage: Stage, role: str, address: Address) -> TimelineSource:
    """A source in the session's world. Raises DeviceError."""
    address.only(*OPTIONS)
    world = shared_world(stage)
    clock = world.clocks[role]

    def describe() -> SourceInfo:
        return SourceInfo(
            address.text,
            role,
            message("simulated {role}, {screen}", role=role, screen=world.rig.screen.name),
            message("kernel stamps, simulated")
            if role == "touch"
            else message("own clock, compared with the host's once a second"),
            {"seed": stage.seed, "true_offset_s": clock.offset_s, "true_drift": clock.drift},
        )

    if role == "touch":
        return SimulatedTouch(address.text, stage, world, describe)
    return TimelineSource(
        address.text,
        role,
        stage.time_base,
        world.timelines[role],
        describe,
        device_clock=clock.stamp if role == "walt" else None,
    )
